/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Write a glTF 2.0 binary file: a header, a JSON chunk and a binary chunk. */
#include "program/export/glb.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "program/export/packed.h"
#include "program/render/render.h"
#include "sh/base/output.h"

static const double step_mm = 0.045; /* smallest unit of quantized positions: they differ by up to
                                    twice as much from the library's */

/* Compute the largest displacement of each vertex from supine over the lying postures, at rest, mm;
 * return the largest of all. `xyz` and `supine_xyz` are workspace, [N, 3]. */
static double find_moves(const glb *g, float *xyz, float *supine_xyz, float *move) {
  static const double lying[][3] = {{0, 1, 0}, {1, 0, 0}, {0, -1, 0}, {-1, 0, 0}};
  double largest = 0;
  for (size_t p = 0; p < sizeof lying / sizeof *lying; ++p) {
    supine_pose pose;
    if (supine_export_breath_pose(g->source, &g->options->breath, lying[p], 0, &pose, NULL) !=
        SUPINE_OK) {
      continue;
    }
    supine_deform(g->source->basis, &pose, p == 0 ? supine_xyz : xyz);
    for (size_t i = 0; p > 0 && i < g->source->info->vertex_count; ++i) {
      const double d[3] = {(double)xyz[3 * i] - (double)supine_xyz[3 * i],
                           (double)xyz[3 * i + 1] - (double)supine_xyz[3 * i + 1],
                           (double)xyz[3 * i + 2] - (double)supine_xyz[3 * i + 2]};
      move[i] = fmaxf(move[i], (float)hypot(hypot(d[0], d[1]), d[2]));
      largest = fmax(largest, (double)move[i]);
    }
  }
  return largest;
}

/* Colour vertices by displacement, 0 to `end` mm; glTF's vertex colours are linear RGBA. */
static void colour(const float *move, size_t count, double end, uint8_t *colours) {
  for (size_t i = 0; i < count; ++i) {
    double rgb[3];
    supine_render_colour(SUPINE_COLOURS_DISPLACEMENT, fmin(1, (double)move[i] / end), rgb);
    for (size_t k = 0; k < 3; ++k) {
      const double linear = rgb[k] <= 0.04045 ? rgb[k] / 12.92 : pow((rgb[k] + 0.055) / 1.055, 2.4);
      colours[4 * i + k] = (uint8_t)lrint(255 * linear);
    }
    colours[4 * i + 3] = 255;
  }
}

/* Append a mesh for each lung; set the displacement at the end of the colours, mm. */
static supine_status add_lungs(glb *g, json_int_t *nodes, double *end, supine_error *error) {
  static const double white[3] = {1, 1, 1};
  const export_source *s = g->source;
  const size_t n = s->info->vertex_count;
  export_order order = {0};
  float *base = malloc(3 * n * sizeof *base);
  float *xyz = malloc(3 * n * sizeof *xyz);
  float *move = calloc(n, sizeof *move);
  float *added = malloc(3 * n * g->targets.count * sizeof *added);
  uint8_t *colours = malloc(4 * n);
  supine_status status = supine_export_order_make(s, !g->options->plain, &order, error);
  if (status == SUPINE_OK &&
      (base == NULL || xyz == NULL || move == NULL || added == NULL || colours == NULL)) {
    status = supine_error_set(error, SUPINE_ERROR_MEMORY, "out of memory");
  }
  if (status != SUPINE_OK) {
    goto cleanup;
  }
  *end = supine_render_bar_end(find_moves(g, xyz, base, move));
  colour(move, n, *end, colours);
  status =
      supine_export_targets_normals(s, &g->options->breath, &g->targets,
                                    g->options->plain ? NULL : order.vertex, base, added, error);
  for (size_t lung = 0; status == SUPINE_OK && lung < s->info->lung_count; ++lung) {
    char name[64];
    (void)snprintf(name, sizeof name, "%s lung", s->info->lung_names[lung]);
    const json_int_t material =
        supine_export_glb_material(g, name, white, g->options->inside != NULL ? 0.3 : 1);
    const uint32_t *own = order.corners + order.corner_begin[lung];
    const size_t count = order.corner_begin[lung + 1] - order.corner_begin[lung];
    const glb_shape shape = {name,    s, lung, order.vertex, base,     added,
                             colours, 1, &own, &count,       &material};
    nodes[lung] = supine_export_glb_add(g, &shape);
  }
cleanup:
  free(base);
  free(xyz);
  free(move);
  free(added);
  free(colours);
  supine_export_order_free(&order);
  return status;
}

/* Append the node "patient" with the lungs and their content, the animations, the table and the
 * arrow of gravity. */
static supine_status add_all(glb *g, double *end, json_t **roots, supine_error *error) {
  const size_t lung_count = g->source->info->lung_count;
  json_int_t nodes[2 * SUPINE_LUNGS_MAX];
  size_t lungs[2 * SUPINE_LUNGS_MAX];
  size_t count = lung_count;
  float q[4];
  supine_export_glb_rotation(0, q);
  json_t *children = json_array();
  (void)json_array_append_new(g->nodes, json_pack("{s:s, s:o, s:[f,f,f,f]}", "name", "patient",
                                                  "children", children, "rotation", (double)q[0],
                                                  (double)q[1], (double)q[2], (double)q[3]));
  const supine_status status = add_lungs(g, nodes, end, error);
  if (status != SUPINE_OK) {
    return status;
  }
  for (size_t lung = 0; lung < lung_count; ++lung) {
    lungs[lung] = lung;
  }
  if (g->options->inside != NULL) {
    supine_export_glb_inside(g, &count, nodes, lungs);
  }
  for (size_t i = 0; i < count; ++i) {
    (void)json_array_append_new(children, json_integer(nodes[i]));
  }
  if (g->options->animate && g->status == SUPINE_OK) {
    supine_export_glb_animate(g, count, nodes, lungs);
  }
  *roots = supine_export_glb_room(g);
  return g->status == SUPINE_OK ? SUPINE_OK : supine_error_set(error, g->status, "out of memory");
}

/* Build the file's JSON. The second buffer of a compressed file is a fallback without data: its
 * size is that of the decoded arrays. */
static json_t *make_root(glb *g, size_t bytes, double end, json_t *roots) {
  static const char packed[] = "EXT_meshopt_compression";
  json_t *root =
      json_pack("{s:{s:s, s:s}, s:i, s:[{s:s, s:o}], s:O, s:O, s:O, s:O, s:O, s:[{s:I}], s:o}",
                "asset", "version", "2.0", "generator", "supine", "scene", 0, "scenes", "name",
                "lungs", "nodes", roots, "nodes", g->nodes, "meshes", g->meshes, "materials",
                g->materials, "bufferViews", g->views, "accessors", g->accessors, "buffers",
                "byteLength", (json_int_t)bytes, "extras", supine_export_glb_extras(g, end));
  if (!g->options->plain) {
    (void)json_array_append_new(json_object_get(root, "buffers"),
                                json_pack("{s:I, s:{s:{s:b}}}", "byteLength",
                                          (json_int_t)g->unpacked, "extensions", packed, "fallback",
                                          1));
    json_t *names = json_pack("[s, s]", packed, "KHR_mesh_quantization");
    (void)json_object_set(root, "extensionsUsed", names);
    (void)json_object_set_new(root, "extensionsRequired", names);
  }
  if (json_array_size(g->animations) > 0) {
    (void)json_object_set(root, "animations", g->animations);
  }
  return root;
}

static supine_status write_file(const char *path, const char *text, const char *numbers,
                                size_t bytes, size_t *total, supine_error *error) {
  enum { VERSION = 2 };
  static const uint32_t magic = 0x46546C67, json_chunk = 0x4E4F534A, binary_chunk = 0x004E4942;
  const size_t length = strlen(text);
  const size_t padding = -length % 4;
  *total = 12 + 8 + length + padding + 8 + bytes;
  if (*total > UINT32_MAX) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "%s: %zu bytes exceed the 4 GiB of glTF binary: use fewer modes or "
                            "vertices",
                            path, *total);
  }
  supine_output output = {0};
  supine_status status = supine_output_open(path, &output, error);
  if (status != SUPINE_OK) {
    return status;
  }
  const uint32_t head[] = {magic, VERSION, (uint32_t)*total, (uint32_t)(length + padding),
                           json_chunk};
  const uint32_t tail[] = {(uint32_t)bytes, binary_chunk};
  (void)fwrite(head, sizeof head, 1, output.file);
  (void)fwrite(text, 1, length, output.file);
  (void)fwrite("   ", 1, padding, output.file);
  (void)fwrite(tail, sizeof tail, 1, output.file);
  (void)fwrite(numbers, 1, bytes, output.file);
  status = supine_output_commit(&output, error);
  supine_output_abandon(&output);
  return status;
}

/* Build all parts in memory, then write the file. */
static supine_status make_and_write(glb *g, const char *path, size_t *total, supine_error *error) {
  char *numbers = NULL;
  size_t bytes = 0;
  double end = 0;
  json_t *roots = NULL;
  g->numbers = open_memstream(&numbers, &bytes);
  if (g->numbers == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "out of memory");
  }
  supine_status status = add_all(g, &end, &roots, error);
  const bool whole = ferror(g->numbers) == 0;
  if (fclose(g->numbers) != 0 || !whole) {
    status = supine_error_set(error, SUPINE_ERROR_MEMORY, "%s: out of memory", path);
  }
  if (status == SUPINE_OK) {
    json_t *root = make_root(g, bytes, end, roots);
    char *text = json_dumps(root, JSON_COMPACT | JSON_REAL_PRECISION(9));
    status = text == NULL ? supine_error_set(error, SUPINE_ERROR_MEMORY, "%s: out of memory", path)
                          : write_file(path, text, numbers, bytes, total, error);
    free(text); /* jansson's default allocator is malloc */
    json_decref(root);
  }
  free(numbers);
  return status;
}

supine_status supine_export_glb_write(const char *path, const export_source *source,
                                      const export_glb_options *options, size_t *bytes,
                                      supine_error *error) {
  if (source->info->triangle_count == 0) {
    return supine_error_set(error, SUPINE_ERROR_MESH,
                            "the basis has no triangles to draw: precompute it from a surface");
  }
  supine_status status = supine_export_pack_begin(error);
  glb *g = status == SUPINE_OK ? calloc(1, sizeof *g) : NULL;
  if (g == NULL) {
    return status != SUPINE_OK ? status
                               : supine_error_set(error, SUPINE_ERROR_MEMORY, "out of memory");
  }
  *g = (glb){.source = source, .options = options};
  json_t **const parts[] = {&g->views, &g->accessors, &g->meshes,
                            &g->nodes, &g->materials, &g->animations};
  for (size_t i = 0; i < sizeof parts / sizeof *parts; ++i) {
    *parts[i] = json_array();
  }
  status = supine_export_targets_choose(source, &options->breath, &g->targets, error);
  g->step = options->plain ? 1 : fmax(step_mm, g->targets.reach / (INT16_MAX / 2));
  if (status == SUPINE_OK) {
    status = make_and_write(g, path, bytes, error);
  }
  for (size_t i = 0; i < sizeof parts / sizeof *parts; ++i) {
    json_decref(*parts[i]);
  }
  free(g);
  return status;
}
