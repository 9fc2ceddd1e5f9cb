/* SPDX-License-Identifier: GPL-3.0-or-later */
/* glTF 2.0 binary: a header, a chunk of JSON, a chunk of numbers. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "program/export/glb.h"

enum { CHUNK_ALIGNMENT = 4 };
static const uint32_t magic = 0x46546C67, version = 2, json_chunk = 0x4E4F534A,
                      binary_chunk = 0x004E4942;

/* A file being written. */
typedef struct glb {
  const export_source *source;
  const export_glb_options *options;
  export_targets targets;
  glb_animation animation;
  float *xyz;         /* [N, 3] */
  float *base_normal; /* [N, 3] */
  float *normal;      /* [J, N, 3], what the targets add */
  uint32_t *corners;  /* [M, 3], lung by lung */
  size_t corner_begin[SUPINE_LUNGS_MAX + 1];
  int16_t *short4; /* [N, 4], where quantised */
  glb_inside inside;
  glb_plan plan;
} glb;

static void group_triangles(glb *g) {
  const supine_basis_info *info = g->source->info;
  size_t count = 0;
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    g->corner_begin[lung] = 3 * count;
    for (size_t t = 0; t < info->triangle_count; ++t) {
      const uint32_t *corner = g->source->triangles + 3 * t;
      if (corner[0] >= info->lung_begin[lung] && corner[0] < info->lung_begin[lung + 1]) {
        memcpy(g->corners + 3 * count++, corner, 3 * sizeof *corner);
      }
    }
  }
  g->corner_begin[info->lung_count] = 3 * count;
}

/* Names of the lungs, in their order: the metadata's, else their numbers. */
static json_t *lung_names(const export_source *source) {
  const char *at = supine_basis_metadata(source->basis, "lungs");
  json_t *names = json_array();
  for (size_t lung = 0; lung < source->info->lung_count; ++lung) {
    const size_t length = at != NULL ? strcspn(at, ",") : 0;
    json_t *name = length > 0 ? json_stringn(at, length) : NULL;
    (void)json_array_append_new(names, name != NULL ? name : json_sprintf("lung %zu", lung));
    at = length > 0 && at[length] == ',' ? at + length + 1 : NULL;
  }
  return names;
}

/* Accessors in the order in which write_numbers writes them: each lung's indices, base, normals,
 * targets and what they add to the normals. */
static json_t *plan_mesh(glb *g) {
  const size_t n = g->source->info->vertex_count;
  const size_t lungs = g->source->info->lung_count;
  const int type = g->options->quantise ? GLTF_SHORT : GLTF_FLOAT;
  double low[3];
  double high[3];
  for (size_t lung = 0; lung < lungs; ++lung) {
    (void)supine_export_glb_plan_add(&g->plan, GLTF_UINT, "SCALAR",
                                     g->corner_begin[lung + 1] - g->corner_begin[lung],
                                     GLTF_INDICES, 1, NULL, NULL);
  }
  supine_export_targets_base(g->source, &g->targets, g->xyz);
  supine_export_glb_bounds(g->xyz, n, false, low, high);
  const json_int_t base = (json_int_t)supine_export_glb_plan_add(&g->plan, GLTF_FLOAT, "VEC3", n,
                                                                 GLTF_VERTICES, 3, low, high);
  (void)supine_export_glb_plan_add(&g->plan, GLTF_FLOAT, "VEC3", n, GLTF_VERTICES, 3, NULL, NULL);
  json_t *targets = json_array();
  json_t *weights = json_array();
  for (size_t j = 0; j < g->targets.count; ++j) {
    supine_export_targets_fill(g->source, &g->targets, j, g->xyz);
    supine_export_glb_bounds(g->xyz, n, g->options->quantise, low, high);
    const json_int_t at = (json_int_t)supine_export_glb_plan_add(&g->plan, type, "VEC3", n,
                                                                 GLTF_VERTICES, 3, low, high);
    (void)supine_export_glb_plan_add(&g->plan, GLTF_FLOAT, "VEC3", n, GLTF_VERTICES, 3, NULL, NULL);
    (void)json_array_append_new(targets, json_pack("{s:I, s:I}", "POSITION", at, "NORMAL", at + 1));
    /* Write the base at breath scale 0, rounded as the positions are stored. */
    (void)json_array_append_new(weights, json_real(0 - g->targets.offset[j] / g->targets.unit[j]));
  }
  json_t *primitives = json_array();
  for (size_t lung = 0; lung < lungs; ++lung) {
    (void)json_array_append_new(primitives,
                                json_pack("{s:{s:I, s:I}, s:I, s:I, s:O}", "attributes", "POSITION",
                                          base, "NORMAL", base + 1, "indices", (json_int_t)lung,
                                          "material", (json_int_t)lung, "targets", targets));
  }
  json_decref(targets);
  return json_pack("{s:s, s:o, s:o, s:o}", "name", "lungs", "primitives", primitives, "weights",
                   weights, "extras", supine_export_glb_extras(g->source, g->options, &g->targets));
}

/* A material for each lung, by its name; seen through where something is inside. */
static json_t *materials(const export_source *source, bool inside) {
  const double alpha = inside ? 0.3 : 1.0;
  json_t *names = lung_names(source);
  json_t *list = json_array();
  for (size_t lung = 0; lung < source->info->lung_count; ++lung) {
    (void)json_array_append_new(list, json_pack("{s:O, s:{s:[f,f,f,f], s:f, s:f}, s:b}", "name",
                                                json_array_get(names, lung), "pbrMetallicRoughness",
                                                "baseColorFactor", 0.80, 0.45, 0.42, alpha,
                                                "metallicFactor", 0.0, "roughnessFactor", 0.55,
                                                "doubleSided", 1));
    if (alpha < 1.0) {
      (void)json_object_set_new(json_array_get(list, lung), "alphaMode", json_string("BLEND"));
    }
  }
  json_decref(names);
  return list;
}

/* Node 0, the patient, turns, about the lungs' middle where it is animated; node 1 takes
 * millimetres LPS, or counts, to metres with y up. */
static json_t *nodes(const glb *g) {
  const double half = sqrt(0.5);
  const double metres = 1e-3 * g->targets.count_mm;
  double low[3];
  double high[3];
  double to[3];
  supine_export_glb_bounds(g->source->vertices, g->source->info->vertex_count, false, low, high);
  for (int axis = 0; axis < 3; ++axis) {
    to[axis] = g->options->animate ? -1e-3 * (low[axis] + high[axis]) / 2 : 0;
  }
  return json_pack("[{s:s, s:[i]}, {s:s, s:i, s:[f,f,f,f], s:[f,f,f], s:[f,f,f]}]", "name",
                   "patient", "children", 1, "name", "lungs", "mesh", 0, "rotation", -half, 0.0,
                   0.0, half, "scale", metres, metres, metres, "translation", to[0], to[2], -to[1]);
}

/* A second mesh at node 2, beside the lungs', with their weights. */
static void add_inside(glb *g, json_t *root) {
  json_t *lungs = json_array_get(json_object_get(root, "meshes"), 0);
  json_t *node = json_deep_copy(json_array_get(json_object_get(root, "nodes"), 1));
  json_t *list = json_object_get(root, "materials");
  json_t *mesh = supine_export_glb_inside_plan(&g->inside, &g->targets,
                                               (json_int_t)g->source->info->lung_count, &g->plan);
  json_t *more = supine_export_glb_inside_materials(&g->inside);
  (void)json_object_set(mesh, "weights", json_object_get(lungs, "weights"));
  (void)json_object_set(json_object_get(mesh, "extras"), "targetNames",
                        json_object_get(json_object_get(lungs, "extras"), "targetNames"));
  (void)json_array_append_new(json_object_get(root, "meshes"), mesh);
  (void)json_object_set_new(node, "name", json_string("inside"));
  (void)json_object_set_new(node, "mesh", json_integer(1));
  (void)json_array_append_new(json_object_get(root, "nodes"), node);
  (void)json_array_append_new(
      json_object_get(json_array_get(json_object_get(root, "nodes"), 0), "children"),
      json_integer(2));
  (void)json_array_extend(list, more);
  json_decref(more);
}

static json_t *make_json(glb *g) {
  g->plan = (glb_plan){json_array(), json_array(), 0};
  json_t *mesh = plan_mesh(g);
  json_t *root = json_pack("{s:{s:s, s:s}, s:i, s:[{s:s, s:[i]}], s:o, s:[o], s:o}", "asset",
                           "version", "2.0", "generator", "supine", "scene", 0, "scenes", "name",
                           "lungs", "nodes", 0, "nodes", nodes(g), "meshes", mesh, "materials",
                           materials(g->source, g->options->inside != NULL));
  if (root == NULL) {
    return NULL;
  }
  if (g->options->inside != NULL) {
    add_inside(g, root);
  }
  if (g->options->quantise) {
    (void)json_object_set_new(root, "extensionsUsed", json_pack("[s]", "KHR_mesh_quantization"));
    (void)json_object_set_new(root, "extensionsRequired",
                              json_pack("[s]", "KHR_mesh_quantization"));
  }
  if (g->options->animate) {
    (void)json_object_set_new(root, "animations",
                              supine_export_glb_animation_plan(&g->animation, g->targets.count,
                                                               g->options->inside != NULL ? 2 : 1,
                                                               &g->plan));
  }
  const bool good =
      json_object_set(root, "bufferViews", g->plan.views) == 0 &&
      json_object_set(root, "accessors", g->plan.accessors) == 0 &&
      json_object_set_new(root, "buffers",
                          json_pack("[{s:I}]", "byteLength", (json_int_t)g->plan.bytes)) == 0;
  if (!good) {
    json_decref(root);
    return NULL;
  }
  return root;
}

static void write_target(glb *g, size_t j, FILE *file) {
  const size_t n = g->source->info->vertex_count;
  supine_export_targets_fill(g->source, &g->targets, j, g->xyz);
  if (!g->options->quantise) {
    (void)fwrite(g->xyz, 3 * sizeof *g->xyz, n, file);
  } else {
    for (size_t i = 0; i < n; ++i) {
      for (size_t axis = 0; axis < 3; ++axis) {
        g->short4[4 * i + axis] = (int16_t)rint((double)g->xyz[3 * i + axis]);
      }
    }
    (void)fwrite(g->short4, 4 * sizeof *g->short4, n, file);
  }
  (void)fwrite(g->normal + 3 * j * n, 3 * sizeof *g->normal, n, file);
}

static void write_numbers(glb *g, FILE *file) {
  const size_t n = g->source->info->vertex_count;
  (void)fwrite(g->corners, sizeof *g->corners, g->corner_begin[g->source->info->lung_count], file);
  supine_export_targets_base(g->source, &g->targets, g->xyz);
  (void)fwrite(g->xyz, 3 * sizeof *g->xyz, n, file);
  (void)fwrite(g->base_normal, 3 * sizeof *g->base_normal, n, file);
  for (size_t j = 0; j < g->targets.count; ++j) {
    write_target(g, j, file);
  }
  if (g->options->inside != NULL) {
    supine_export_glb_inside_write(&g->inside, &g->targets, file);
  }
  if (g->options->animate) {
    const glb_animation *a = &g->animation;
    (void)fwrite(a->times, sizeof *a->times, a->frames, file);
    (void)fwrite(a->weights, g->targets.count * sizeof *a->weights, a->frames, file);
    (void)fwrite(a->rotations, 4 * sizeof *a->rotations, a->frames, file);
  }
}

static supine_status write_file(glb *g, const char *path, const char *text, size_t *bytes,
                                supine_error *error) {
  const size_t length = strlen(text);
  const size_t padded = (length + CHUNK_ALIGNMENT - 1) / CHUNK_ALIGNMENT * CHUNK_ALIGNMENT;
  const size_t total = 12 + 8 + padded + 8 + g->plan.bytes; /* the numbers are all of 4 bytes */
  if (total > UINT32_MAX) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "%s: %zu bytes, and glTF binary ends at 4 GiB: take fewer modes or "
                            "vertices",
                            path, total);
  }
  supine_output output = {0};
  supine_status status = supine_output_open(path, &output, error);
  if (status != SUPINE_OK) {
    return status;
  }
  const uint32_t head[] = {magic, version, (uint32_t)total, (uint32_t)padded, json_chunk};
  const uint32_t tail[] = {(uint32_t)g->plan.bytes, binary_chunk};
  (void)fwrite(head, sizeof head, 1, output.file);
  (void)fwrite(text, 1, length, output.file);
  (void)fwrite("   ", 1, padded - length, output.file);
  (void)fwrite(tail, sizeof tail, 1, output.file);
  write_numbers(g, output.file);
  status = supine_output_commit(&output, error);
  supine_output_abandon(&output);
  *bytes = total;
  return status;
}

/* Over 60 lines: the file from its first part to its last. */
supine_status supine_export_glb_write(const char *path, const export_source *source,
                                      const export_glb_options *options, export_glb_report *report,
                                      supine_error *error) {
  const size_t n = source->info->vertex_count;
  export_glb_options safe = *options;
  safe.clamp_safe |= options->animate;
  glb g = {.source = source, .options = &safe};
  json_t *root = NULL;
  char *text = NULL;
  if (source->info->triangle_count == 0) {
    return supine_error_set(error, SUPINE_ERROR_MESH, "a basis without triangles shows nothing");
  }
  supine_status status = supine_export_targets_choose(source, &safe, &g.targets, error);
  if (status == SUPINE_OK && options->animate) {
    status = supine_export_glb_animation_make(source, &safe, &g.targets, &g.animation, error);
  }
  if (status == SUPINE_OK && options->inside != NULL) {
    status = supine_export_glb_inside_make(options->inside, options->parts, &g.inside, error);
  }
  if (status != SUPINE_OK) {
    goto cleanup;
  }
  g.xyz = malloc(3 * n * sizeof *g.xyz);
  g.base_normal = malloc(3 * n * sizeof *g.base_normal);
  g.normal = malloc((3 * n * g.targets.count + 1) * sizeof *g.normal);
  g.corners = malloc(3 * source->info->triangle_count * sizeof *g.corners);
  g.short4 = calloc(options->quantise ? 4 * n : 4, sizeof *g.short4);
  if (g.xyz != NULL && g.base_normal != NULL && g.normal != NULL && g.corners != NULL &&
      g.short4 != NULL) {
    group_triangles(&g);
    status = supine_export_targets_normals(source, &safe.breath, &g.targets, g.base_normal,
                                           g.normal, error);
    if (status != SUPINE_OK) {
      goto cleanup;
    }
    root = make_json(&g);
    text = root == NULL ? NULL : json_dumps(root, JSON_COMPACT);
  }
  if (text == NULL) {
    status = supine_error_set(error, SUPINE_ERROR_MEMORY, "%s: out of memory", path);
    goto cleanup;
  }
  status = write_file(&g, path, text, &report->bytes, error);
  report->targets = g.targets.count;
  report->loss_percent = g.targets.loss_percent;

cleanup:
  free(text); /* as jansson's default allocator gave it */
  json_decref(root);
  json_decref(g.plan.views);
  json_decref(g.plan.accessors);
  free(g.xyz);
  free(g.base_normal);
  free(g.normal);
  free(g.corners);
  free(g.short4);
  supine_export_glb_animation_free(&g.animation);
  supine_export_glb_inside_free(&g.inside);
  supine_export_targets_free(&g.targets);
  return status;
}
