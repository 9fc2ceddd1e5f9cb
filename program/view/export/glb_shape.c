/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Append meshes to a glTF file: lungs with morph targets, a table under the patient, and an arrow
 * that shows gravity. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "program/view/export/glb.h"

/* Append a mesh and a node that refers to it, and return the index of the node. Positions in the
 * mesh are in LPS axes, relative to the centre of the lungs, in units of glb.step. The node
 * converts them to metres with y up. `g` owns `mesh` then. */
static json_int_t show(glb *g, const char *name, json_t *mesh) {
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

static json_int_t add_material(glb *g, const char *name, const double rgb[3]) {
  (void)json_array_append_new(g->materials,
                              json_pack("{s:s, s:{s:[f,f,f,f], s:f, s:f}, s:b}", "name", name,
                                        "pbrMetallicRoughness", "baseColorFactor", rgb[0], rgb[1],
                                        rgb[2], 1.0, "metallicFactor", 0.0, "roughnessFactor", 0.55,
                                        "doubleSided", 1));
  return (json_int_t)json_array_size(g->materials) - 1;
}

/* Compute the displacement of a vertex by morph target `j` at weight 1, in units of glb.step. */
static void place_target(const glb *g, size_t lung, size_t j, size_t vertex, double xyz[3]) {
  supine_export_targets_field(&g->targets, vertex, j, xyz);
  for (size_t axis = 0; axis < 3; ++axis) {
    xyz[axis] *= g->targets.lung[lung].unit[j] / g->step;
  }
}

/* Compute the position of a vertex of the base mesh, in units of glb.step. If the file rounds morph
 * targets, correct the position so that the deformed vertex is exact at the weights `rest`. */
static void place_base(const glb *g, size_t lung, const double *rest, size_t vertex,
                       double xyz[3]) {
  supine_export_targets_base(&g->targets, lung, vertex, xyz);
  for (size_t axis = 0; axis < 3; ++axis) {
    xyz[axis] /= g->step;
  }
  if (g->options->plain) {
    return;
  }
  for (size_t j = 0; j < g->targets.count; ++j) {
    double target[3];
    place_target(g, lung, j, vertex, target);
    for (size_t axis = 0; axis < 3; ++axis) {
      xyz[axis] += rest[j] * (target[axis] - rint(target[axis]));
    }
  }
}

/* Append one lung's part of an array over all vertices; return the index of the accessor. */
static json_int_t put(glb *g, size_t lung, glb_kind kind, const void *rows) {
  const size_t *begin = g->order.lung_begin + lung;
  return supine_export_glb_put(g, kind, rows, g->order.vertex + begin[0], begin[1] - begin[0]);
}

/* Append a lung's displacements by morph target `j`, or the positions of its base mesh if `j` is
 * the number of targets. */
static json_int_t put_places(glb *g, size_t lung, size_t j, const double *rest) {
  const size_t *begin = g->info->lung_begin + lung;
  for (size_t i = begin[0]; i < begin[1]; ++i) {
    double at[3];
    if (j < g->targets.count) {
      place_target(g, lung, j, i, at);
    } else {
      place_base(g, lung, rest, i, at);
    }
    for (size_t axis = 0; axis < 3; ++axis) {
      g->xyz[3 * i + axis] = (float)at[axis];
    }
  }
  return put(g, lung, GLB_POSITIONS, g->xyz);
}

/* Append the vectors that morph target `j` adds to the normals of a lung. */
static json_int_t put_changes(glb *g, size_t lung, size_t j) {
  const supine_basis_info *info = g->info;
  const size_t *begin = info->lung_begin + lung;
  const float *added = g->added + 3 * j * info->vertex_count;
  for (size_t i = 3 * begin[0]; i < 3 * begin[1]; ++i) {
    if (added[i] != 0) {
      return put(g, lung, GLB_NORMAL_CHANGES, added);
    }
  }
  const size_t *written = g->order.lung_begin + lung;
  return supine_export_glb_put_zeros(g, GLB_NORMAL_CHANGES, written[1] - written[0]);
}

/* Append a lung's triangles. Their vertex indices count from the lung's first vertex in the
 * file. */
static json_int_t put_corners(glb *g, size_t lung) {
  const size_t *begin = g->order.corner_begin + lung;
  const size_t count = begin[1] - begin[0];
  SUPINE_ARENA arena = {0};
  uint32_t *corners = supine_arena_take(&arena, count, sizeof *corners);
  if (corners == NULL) {
    g->status = SUPINE_ERROR_MEMORY;
    return 0;
  }
  for (size_t i = 0; i < count; ++i) {
    corners[i] = g->order.corners[begin[0] + i] - (uint32_t)g->order.lung_begin[lung];
  }
  return supine_export_glb_put(g, GLB_CORNERS, corners, NULL, count);
}

json_int_t supine_export_glb_add(glb *g, size_t lung) {
  static const double supine[3] = {0, 1, 0};
  static const double tissue[3] = {0.66, 0.32, 0.29}; /* linear */
  json_t *targets = json_array();
  json_t *weights = json_array();
  double rest[EXPORT_TARGETS_MAX];
  char name[64];
  supine_pose pose;
  (void)snprintf(name, sizeof name, "%s lung", g->info->lung_names[lung]);
  (void)supine_export_breath_pose(g->basis, g->options->breath, supine, 0, &pose, NULL);
  supine_export_targets_weights(&g->targets, &pose, lung, rest);
  for (size_t j = 0; j < g->targets.count; ++j) {
    (void)json_array_append_new(targets,
                                json_pack("{s:I, s:I}", "POSITION", put_places(g, lung, j, rest),
                                          "NORMAL", put_changes(g, lung, j)));
    (void)json_array_append_new(weights, json_real(rest[j]));
  }
  const json_int_t places = put_places(g, lung, g->targets.count, rest);
  const json_int_t normals = put(g, lung, GLB_NORMALS, g->normals);
  const json_int_t corners = put_corners(g, lung);
  return show(g, name,
              json_pack("{s:[{s:{s:I, s:I}, s:I, s:I, s:o}], s:o, s:o}", "primitives", "attributes",
                        "POSITION", places, "NORMAL", normals, "indices", corners, "material",
                        add_material(g, name, tissue), "targets", targets, "weights", weights,
                        "extras", supine_export_glb_lung_extras(g, lung)));
}

enum { SIDES = 16, RINGS = 5 };

/* Append a solid of revolution about the vertical axis and return its node. `profile` has the
 * radius and the height of each ring, mm. The mesh has no normals, so that facets look flat. */
static json_int_t sweep(glb *g, const char *name, const double profile[RINGS][2], size_t sides,
                        const double rgb[3]) {
  float places[RINGS * SIDES][3];
  uint32_t corners[(RINGS - 1) * SIDES * 6];
  size_t at = 0;
  for (size_t ring = 0; ring < RINGS; ++ring) {
    for (size_t i = 0; i < sides; ++i) {
      const double angle = 6.28318530717958648 * ((double)i + 0.5) / (double)sides;
      float *place = places[ring * sides + i];
      place[0] = (float)(profile[ring][0] * cos(angle) / g->step);
      place[1] = (float)(profile[ring][0] * sin(angle) / g->step);
      place[2] = (float)(profile[ring][1] / g->step);
    }
  }
  for (size_t ring = 0; ring + 1 < RINGS; ++ring) {
    for (size_t i = 0; i < sides; ++i) {
      const uint32_t a = (uint32_t)(ring * sides + i);
      const uint32_t b = (uint32_t)(ring * sides + (i + 1) % sides);
      const uint32_t up = (uint32_t)sides;
      const uint32_t quad[] = {a, b, b + up, a, b + up, a + up};
      memcpy(corners + at, quad, sizeof quad);
      at += 6;
    }
  }
  const json_int_t material = add_material(g, name, rgb);
  const json_int_t indices = supine_export_glb_put(g, GLB_CORNERS, corners, NULL, at);
  return show(g, name,
              json_pack("{s:[{s:{s:I}, s:I, s:I}]}", "primitives", "attributes", "POSITION",
                        supine_export_glb_put(g, GLB_POSITIONS, places, NULL, RINGS * sides),
                        "indices", indices, "material", material));
}

json_t *supine_export_glb_room(glb *g) {
  static const double grey[3] = {0.45, 0.52, 0.62};
  static const double red[3] = {0.80, 0.25, 0.05};
  const double r = g->targets.half_extent;
  const double top = -1.15 * r;
  const double table[RINGS][2] = {
      {0, top - 0.06 * r}, {1.5 * r, top - 0.06 * r}, {1.5 * r, top}, {0, top}, {0, top}};
  const double low = top + 0.02 * r;
  const double arrow[RINGS][2] = {{0, low},
                                  {0.08 * r, low + 0.16 * r},
                                  {0.03 * r, low + 0.16 * r},
                                  {0.03 * r, low + 0.45 * r},
                                  {0, low + 0.45 * r}};
  const json_int_t under = sweep(g, "table", table, 4, grey);
  const json_int_t down = sweep(g, "gravity", arrow, SIDES, red);
  (void)json_object_set_new(json_array_get(g->nodes, (size_t)down), "translation",
                            json_pack("[f,f,f]", 1.25e-3 * r, 0.0, 0.0));
  return json_pack("[i, I, I]", 0, under, down);
}
