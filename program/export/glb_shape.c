/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Append meshes with morph targets, nodes and materials to a glTF file. */
#include <math.h>
#include <stdlib.h>

#include "program/export/glb.h"

json_int_t supine_export_glb_show(glb *g, const char *name, json_t *mesh) {
  const double half = sqrt(0.5);
  const double metres = 1e-3 * g->step;
  (void)json_object_set_new(mesh, "name", json_string(name));
  (void)json_array_append_new(g->nodes,
                              json_pack("{s:s, s:I, s:[f,f,f,f], s:[f,f,f]}", "name", name, "mesh",
                                        (json_int_t)json_array_size(g->meshes), "rotation", -half,
                                        0.0, 0.0, half, "scale", metres, metres, metres));
  (void)json_array_append_new(g->meshes, mesh);
  return (json_int_t)json_array_size(g->nodes) - 1;
}

json_int_t supine_export_glb_material(glb *g, const char *name, const double rgb[3], double alpha) {
  json_t *material =
      json_pack("{s:s, s:{s:[f,f,f,f], s:f, s:f}, s:b}", "name", name, "pbrMetallicRoughness",
                "baseColorFactor", rgb[0], rgb[1], rgb[2], alpha, "metallicFactor", 0.0,
                "roughnessFactor", 0.55, "doubleSided", 1);
  if (alpha < 1) {
    (void)json_object_set_new(material, "alphaMode", json_string("BLEND"));
  }
  (void)json_array_append_new(g->materials, material);
  return (json_int_t)json_array_size(g->materials) - 1;
}

/* Compute the displacement of a vertex in target `j`, in units of glb.step. */
static void place_target(const glb *g, const glb_shape *shape, size_t j, size_t vertex,
                         double xyz[3]) {
  supine_export_targets_field(shape->source, vertex, j, xyz);
  for (size_t axis = 0; axis < 3; ++axis) {
    xyz[axis] *= g->targets.lung[shape->lung].unit[j] / g->step;
  }
}

/* Compute a vertex of the base mesh, in units of glb.step, with a correction that cancels the
 * rounding of the targets at the weights `rest`. */
static void place_base(const glb *g, const glb_shape *shape, const double *rest, size_t vertex,
                       double xyz[3]) {
  supine_export_targets_base(shape->source, &g->targets, shape->lung, vertex, xyz);
  for (size_t axis = 0; axis < 3; ++axis) {
    xyz[axis] /= g->step;
  }
  for (size_t j = 0; !g->options->plain && j < g->targets.count; ++j) {
    double target[3];
    place_target(g, shape, j, vertex, target);
    for (size_t axis = 0; axis < 3; ++axis) {
      xyz[axis] += rest[j] * (target[axis] - rint(target[axis]));
    }
  }
}

/* Append the positions of target `j` of a shape, or of the base if `j` is the number of targets.
 * `xyz` is workspace, [N, 3]. */
static json_int_t put_places(glb *g, const glb_shape *shape, size_t j, const double *rest,
                             float *xyz) {
  const size_t *begin = shape->source->info->lung_begin + shape->lung;
  for (size_t i = begin[0]; i < begin[1]; ++i) {
    double at[3];
    if (j < g->targets.count) {
      place_target(g, shape, j, i, at);
    } else {
      place_base(g, shape, rest, i, at);
    }
    for (size_t axis = 0; axis < 3; ++axis) {
      xyz[3 * i + axis] = (float)at[axis];
    }
  }
  return supine_export_glb_put(g, GLB_PLACES, xyz, shape->order + begin[0], begin[1] - begin[0]);
}

/* Append what target `j` adds to the normals. */
static json_int_t put_changes(glb *g, const glb_shape *shape, size_t j) {
  const supine_basis_info *info = shape->source->info;
  const size_t *begin = info->lung_begin + shape->lung;
  const float *added = shape->added + 3 * j * info->vertex_count;
  for (size_t i = 3 * begin[0]; i < 3 * begin[1]; ++i) {
    if (added[i] != 0) {
      return supine_export_glb_put(g, GLB_CHANGES, added, shape->order + begin[0],
                                   begin[1] - begin[0]);
    }
  }
  return supine_export_glb_put_zeros(g, GLB_CHANGES, begin[1] - begin[0]);
}

/* Append the triangles of a part, renumbered from the shape's first vertex. */
static json_int_t put_corners(glb *g, const glb_shape *shape, size_t part) {
  const size_t count = shape->corner_count[part];
  uint32_t *corners = malloc((count + 1) * sizeof *corners);
  json_int_t at = 0;
  for (size_t i = 0; corners != NULL && i < count; ++i) {
    corners[i] = shape->corners[part][i] - (uint32_t)shape->source->info->lung_begin[shape->lung];
  }
  if (corners != NULL) {
    at = supine_export_glb_put(g, GLB_CORNERS, corners, NULL, count);
  } else {
    g->status = SUPINE_ERROR_MEMORY;
  }
  free(corners);
  return at;
}

json_int_t supine_export_glb_add(glb *g, const glb_shape *shape) {
  const supine_basis_info *info = shape->source->info;
  const size_t first = info->lung_begin[shape->lung];
  const size_t n = info->lung_begin[shape->lung + 1] - first;
  const uint32_t *order = shape->order + first;
  float *xyz = malloc(3 * info->vertex_count * sizeof *xyz);
  json_t *targets = json_array();
  json_t *weights = json_array();
  json_t *primitives = json_array();
  double rest[EXPORT_TARGETS_MAX];
  supine_pose pose;
  static const double supine[3] = {0, 1, 0};
  g->status = xyz == NULL ? SUPINE_ERROR_MEMORY : g->status;
  json_t *attributes = json_object();
  (void)supine_export_breath_pose(g->source, &g->options->breath, supine, 0, &pose, NULL);
  supine_export_targets_weights(g->source, &g->targets, &pose, shape->lung, rest);
  for (size_t j = 0; g->status == SUPINE_OK && j < g->targets.count; ++j) {
    json_t *target = json_pack("{s:I}", "POSITION", put_places(g, shape, j, rest, xyz));
    if (shape->added != NULL) {
      (void)json_object_set_new(target, "NORMAL", json_integer(put_changes(g, shape, j)));
    }
    (void)json_array_append_new(targets, target);
    (void)json_array_append_new(weights, json_real(rest[j]));
  }
  if (g->status == SUPINE_OK) {
    (void)json_object_set_new(attributes, "POSITION",
                              json_integer(put_places(g, shape, g->targets.count, rest, xyz)));
    (void)json_object_set_new(
        attributes, "NORMAL",
        json_integer(supine_export_glb_put(g, GLB_NORMALS, shape->normals, order, n)));
  }
  if (g->status == SUPINE_OK && shape->colours != NULL) {
    (void)json_object_set_new(
        attributes, "COLOR_0",
        json_integer(supine_export_glb_put(g, GLB_COLOURS, shape->colours, order, n)));
  }
  for (size_t part = 0; g->status == SUPINE_OK && part < shape->parts; ++part) {
    if (shape->corner_count[part] > 0) {
      (void)json_array_append_new(primitives,
                                  json_pack("{s:O, s:I, s:I, s:O}", "attributes", attributes,
                                            "indices", put_corners(g, shape, part), "material",
                                            shape->material[part], "targets", targets));
    }
  }
  free(xyz);
  json_decref(targets);
  json_decref(attributes);
  return supine_export_glb_show(g, shape->name,
                                json_pack("{s:o, s:o, s:o}", "primitives", primitives, "weights",
                                          weights, "extras",
                                          supine_export_glb_lung_extras(g, shape->lung)));
}
