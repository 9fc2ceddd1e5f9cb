/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Write a glTF 2.0 binary file: a header, a JSON chunk and a binary chunk. */
#include "program/view/export/glb.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"
#include "base/locale.h"
#include "base/output.h"
#include "program/view/export/packed.h"

/* Smallest quantisation step of positions. Lungs longer than 1.47 m need a larger one. */
static const double step_min_mm = 0.045;

/* Compute the normals of vertices. */
static supine_status prepare(glb *g, supine_error *error) {
  const size_t n = g->info->vertex_count;
  g->xyz = supine_arena_take(&g->arena, n, 3 * sizeof *g->xyz);
  g->normals = supine_arena_take(&g->arena, n, 3 * sizeof *g->normals);
  g->added = supine_arena_take(&g->arena, n * g->targets.count, 3 * sizeof *g->added);
  SUPINE_TRY(supine_arena_check(&g->arena, error, "%zu vertices", n));
  SUPINE_TRY(supine_export_order_make(g->info, !g->options->plain, g->options->simplify, &g->arena,
                                      &g->order, error));
  return supine_export_targets_normals(&g->targets, &g->order, g->options->plain, g->normals,
                                       g->added, error);
}

/* Append the patient with the lungs, the animations, the table under the patient and the arrow of
 * gravity. Set `roots` to the root nodes of the scene. */
static supine_status add_all(glb *g, json_t **roots, supine_error *error) {
  float q[4];
  SUPINE_TRY(prepare(g, error));
  supine_export_glb_rotation(0, q);
  json_t *children = json_array();
  (void)json_array_append_new(g->nodes, json_pack("{s:s, s:o, s:[f,f,f,f]}", "name", "patient",
                                                  "children", children, "rotation", (double)q[0],
                                                  (double)q[1], (double)q[2], (double)q[3]));
  for (size_t lung = 0; lung < g->info->lung_count; ++lung) {
    (void)json_array_append_new(children, json_integer(supine_export_glb_add(g, lung)));
  }
  if (g->options->animate) {
    supine_export_glb_animate(g);
  }
  *roots = supine_export_glb_room(g);
  SUPINE_REFUSE_IF(g->status != SUPINE_OK, error, g->status, "out of memory");
  return SUPINE_OK;
}

/* Complete the file's JSON. A compressed file has a second buffer, the fallback that
 * EXT_meshopt_compression requires: it has the size of the decompressed arrays, but no data. */
static void complete(glb *g, size_t bytes, json_t *roots) {
  static const char packed[] = "EXT_meshopt_compression";
  json_t *buffers = json_object_get(g->root, "buffers");
  (void)json_array_append_new(json_object_get(g->root, "scenes"),
                              json_pack("{s:s, s:o}", "name", "lungs", "nodes", roots));
  (void)json_array_append_new(buffers, json_pack("{s:I}", "byteLength", (json_int_t)bytes));
  (void)json_object_set_new(g->root, "extras", supine_export_glb_extras(g));
  if (!g->options->plain) {
    (void)json_array_append_new(buffers, json_pack("{s:I, s:{s:{s:b}}}", "byteLength",
                                                   (json_int_t)g->unpacked, "extensions", packed,
                                                   "fallback", 1));
    json_t *names = json_pack("[s, s]", packed, "KHR_mesh_quantization");
    (void)json_object_set(g->root, "extensionsUsed", names);
    (void)json_object_set_new(g->root, "extensionsRequired", names);
  }
}

static supine_status write_file(const char *path, const char *text, const char *numbers,
                                size_t bytes, size_t *total, supine_error *error) {
  enum { VERSION = 2 };
  static const uint32_t magic = 0x46546C67, json_chunk = 0x4E4F534A, binary_chunk = 0x004E4942;
  const size_t length = strlen(text);
  const size_t padding = -length % 4;
  *total = 12 + 8 + length + padding + 8 + bytes;
  SUPINE_REFUSE_IF(*total > UINT32_MAX, error, SUPINE_ERROR_ARGUMENT,
                   "%s: %zu bytes exceed glTF's limit of 4 GiB: use fewer modes or vertices", path,
                   *total);
  SUPINE_FREED_BY(supine_output_abandon) supine_output output = {0};
  SUPINE_TRY(supine_output_open(path, &output, error));
  const uint32_t head[] = {magic, VERSION, (uint32_t)*total, (uint32_t)(length + padding),
                           json_chunk};
  const uint32_t tail[] = {(uint32_t)bytes, binary_chunk};
  (void)fwrite(head, sizeof head, 1, output.file);
  (void)fwrite(text, 1, length, output.file);
  (void)fwrite("   ", 1, padding, output.file);
  (void)fwrite(tail, sizeof tail, 1, output.file);
  (void)fwrite(numbers, 1, bytes, output.file);
  return supine_output_commit(&output, error);
}

/* Build both chunks in memory, then write the file. Set `total` to the size of the file, bytes. */
static supine_status make_and_write(glb *g, const char *path, size_t *total, supine_error *error) {
  SUPINE_C_LOCALE;
  char *numbers = NULL;
  size_t bytes = 0;
  json_t *roots = NULL;
  g->numbers = open_memstream(&numbers, &bytes);
  SUPINE_REFUSE_IF(g->numbers == NULL, error, SUPINE_ERROR_MEMORY, "out of memory");
  supine_status status = add_all(g, &roots, error);
  const bool whole = ferror(g->numbers) == 0;
  if (fclose(g->numbers) != 0 || !whole) {
    status = supine_error_set(error, SUPINE_ERROR_MEMORY, "%s: out of memory", path);
  }
  if (status == SUPINE_OK) {
    complete(g, bytes, roots);
    char *text = json_dumps(g->root, JSON_COMPACT | JSON_REAL_PRECISION(9));
    status = text == NULL ? supine_error_set(error, SUPINE_ERROR_MEMORY, "%s: out of memory", path)
                          : write_file(path, text, numbers, bytes, total, error);
    free(text);
  } else {
    json_decref(roots);
  }
  free(numbers);
  return status;
}

static void free_glb(glb **g) {
  if (*g != NULL) {
    json_decref((*g)->root);
    supine_arena_free(&(*g)->arena);
    free(*g);
  }
}

supine_status supine_export_glb_write(const char *path, const supine_basis *basis,
                                      const export_glb_options *options, export_written *written,
                                      supine_error *error) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  SUPINE_REFUSE_IF(info->triangle_count == 0, error, SUPINE_ERROR_MESH,
                   "the basis has no triangles to draw: precompute it from a surface");
  SUPINE_TRY(supine_export_pack_begin(error));
  SUPINE_FREED_BY(free_glb) glb *g = calloc(1, sizeof *g);
  if (g == NULL) {
    return supine_error_memory(error, "%s", path);
  }
  *g = (glb){.basis = basis,
             .info = info,
             .options = options,
             .views = json_array(),
             .accessors = json_array(),
             .meshes = json_array(),
             .nodes = json_array(),
             .materials = json_array()};
  g->root = json_pack("{s:{s:s, s:s}, s:i, s:[], s:o, s:o, s:o, s:o, s:o, s:[]}", "asset",
                      "version", "2.0", "generator", "supine", "scene", 0, "scenes", "nodes",
                      g->nodes, "meshes", g->meshes, "materials", g->materials, "bufferViews",
                      g->views, "accessors", g->accessors, "buffers");
  SUPINE_TRY(supine_export_targets_choose(basis, options->breath, &g->targets, error));
  g->step = options->plain ? 1 : fmax(step_min_mm, g->targets.half_extent / (INT16_MAX / 2));
  *written = (export_written){.bytes = 0};
  SUPINE_TRY(make_and_write(g, path, &written->bytes, error));
  written->vertices = g->order.vertex_count;
  if (options->simplify > 0) {
    SUPINE_TRY(supine_export_order_error(info, &g->order, &written->rms, &written->largest, error));
  }
  return SUPINE_OK;
}
