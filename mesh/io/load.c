/* SPDX-License-Identifier: MIT */
/* Load a file into a welded surface in millimetres, LPS. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"
#include "base/ascii.h"
#include "base/input.h"
#include "base/remedy.h"
#include "base/text.h"

#include "mesh/io/read.h"

static mesh_reader *find_reader(const char *path) {
  static const struct {
    const char *ending;
    mesh_reader *read;
  } known[] = {{".ply", supine_io_read_ply},   {".vtp", supine_io_read_vtp},
               {".stl", supine_io_read_stl},   {".obj", supine_io_read_obj},
               {".off", supine_io_read_off},   {".ac", supine_io_read_ac},
               {".gltf", supine_io_read_gltf}, {".glb", supine_io_read_gltf}};
  for (size_t i = 0; i < sizeof known / sizeof *known; ++i) {
    if (supine_text_ends_in(path, known[i].ending)) {
      return known[i].read;
    }
  }
  const char *slash = strrchr(path, '/');
  const char *ending = strrchr(slash == NULL ? path : slash, '.');
  return ending != NULL && supine_io_import_knows(ending) ? supine_io_import : NULL;
}

static bool is_letter_or_digit(char c) {
  return supine_ascii_is_letter(c) || supine_ascii_is_digit(c);
}

/* Find the axes in the first 4095 bytes of the file, where 3D Slicer writes a tag such as
 * SPACE=LPS. */
static void find_space(mesh_file *file) {
  char head[4096];
  char letters[4] = "";
  (void)snprintf(head, sizeof head, "%s", (const char *)file->bytes);
  const char *tag = head;
  while (*tag != '\0' && (!supine_ascii_same_begin(tag, "SPACE=", 6) ||
                          (tag > head && is_letter_or_digit(tag[-1])))) {
    ++tag;
  }
  file->tagged = *tag != '\0';
  if (file->tagged && !is_letter_or_digit(tag[strnlen(tag, 9)])) {
    for (size_t k = 0; k < 3; ++k) {
      letters[k] = supine_ascii_upper(tag[strnlen(tag, 6 + k)]);
    }
    (void)supine_mesh_axes_parse(letters, &file->space);
  }
}

static supine_status read_file(mesh_file *file, supine_arena *arena, mesh_reader **reader,
                               supine_error *error) {
  size_t size = 0;
  SUPINE_FREED_BY(supine_file_close) FILE *stream = NULL;
  SUPINE_TRY(supine_input_open(file->path, &stream, &size, error));
  SUPINE_REFUSE_IF(size == 0, error, SUPINE_ERROR_FORMAT,
                   "%s: the file is empty; save the mesh again", file->path);
  file->bytes = supine_arena_take(arena, size + 1, 1);
  SUPINE_TRY(supine_arena_check(arena, error, "%zu bytes of %s", size, file->path));
  errno = 0;
  file->size = fread(file->bytes, 1, size, stream);
  file->bytes[file->size] = '\0';
  SUPINE_REFUSE_IF(ferror(stream) != 0, error, SUPINE_ERROR_READ, "%s: cannot read: %s", file->path,
                   strerror(errno == 0 ? EIO : errno));
  find_space(file);
  SUPINE_TRY(supine_io_find_unit(file, error));
  *reader = find_reader(file->path);
  SUPINE_REFUSE_IF(*reader == NULL && supine_text_ends_in(file->path, ".vtk"), error,
                   SUPINE_ERROR_FORMAT,
                   "%s: VTK's older format is not read; save the surface as .vtp or .ply, for "
                   "example with 3D Slicer or ParaView",
                   file->path);
  SUPINE_REFUSE_IF(*reader == NULL, error, SUPINE_ERROR_FORMAT,
                   "%s: no importer for this ending; give the mesh as .ply, .obj, .stl or .vtp",
                   file->path);
  return SUPINE_OK;
}

/* Copy a surface as a reader copies that of a file. */
static supine_status copy_arrays(const char *name, const supine_mesh *given, supine_mesh *mesh,
                                 supine_error *error) {
  mesh_faces faces = {.path = name, .mesh = mesh};
  mesh->vertices = malloc((3 * given->vertex_count + 1) * sizeof *mesh->vertices);
  if (mesh->vertices == NULL) {
    return supine_error_memory(error, "%zu vertices of %s", given->vertex_count, name);
  }
  mesh->vertex_count = given->vertex_count;
  for (size_t i = 0; i < 3 * given->vertex_count; ++i) {
    mesh->vertices[i] = (double)((float)given->vertices[i] + 0.0F); /* + 0 makes -0 to 0 */
  }
  for (size_t t = 0; t < given->triangle_count; ++t) {
    const uint32_t *corner = given->triangles + 3 * t;
    const double corners[3] = {corner[0], corner[1], corner[2]};
    SUPINE_TRY(supine_io_faces_add(&faces, corners, 3, error));
  }
  return SUPINE_OK;
}

static supine_status choose_axes(const mesh_file *file, supine_axes asked,
                                 supine_mesh_report *report, supine_error *error) {
  if (asked != SUPINE_AXES_AUTO) {
    report->axes = asked;
    return SUPINE_OK;
  }
  if (file->tagged && file->space == SUPINE_AXES_AUTO) {
    (void)supine_error_set(error, SUPINE_ERROR_FORMAT,
                           "%s: its SPACE tag is not three letters such as LPS or RAS", file->path);
    const supine_remedy advice[SUPINE_REMEDIES_MAX] = {supine_remedy_such_as("axes", "LPS", "")};
    supine_error_advise(error, advice);
    return SUPINE_ERROR_FORMAT;
  }
  SUPINE_REFUSE_IF(file->turned, error, SUPINE_ERROR_FORMAT,
                   "%s: the file says which axis is up, and its coordinates were turned by that: "
                   "save the surface as PLY, or compare it with the scan, and give the axes that "
                   "it has after the turn",
                   file->path);
  report->axes = file->tagged ? file->space : SUPINE_AXES_LPS;
  report->axes_from_tag = file->tagged;
  return SUPINE_OK;
}

/* Largest coordinate, mm. Single precision resolves it to 1 mm. */
static const double farthest = 1e7;

static supine_status convert(const char *path, double scale, supine_axes axes, supine_mesh *mesh,
                             supine_error *error) {
  for (size_t i = 0; i < mesh->vertex_count; ++i) {
    double *vertex = mesh->vertices + 3 * i;
    const double largest = fmax(fabs(vertex[0]), fmax(fabs(vertex[1]), fabs(vertex[2])));
    SUPINE_REFUSE_IF(!isfinite(vertex[0]) || !isfinite(vertex[1]) || !isfinite(vertex[2]), error,
                     SUPINE_ERROR_MESH,
                     "%s: vertex %zu of %zu has a coordinate that is not finite; repair the mesh",
                     path, i, mesh->vertex_count);
    if (!(largest * scale <= farthest)) {
      const supine_remedy advice[SUPINE_REMEDIES_MAX] = {
          supine_remedy_give("units", "", "if the file is in another unit")};
      return supine_error_advised(
          error, advice,
          supine_error_set(error, SUPINE_ERROR_MESH,
                           "%s: vertex %zu of %zu has a coordinate of %.3g mm: repair the mesh",
                           path, i, mesh->vertex_count, largest * scale));
    }
    supine_mesh_axes_apply(axes, scale, vertex);
  }
  if (supine_mesh_axes_mirrored(axes)) {
    supine_mesh_reverse(mesh);
  }
  return SUPINE_OK;
}

supine_status supine_mesh_load(const char *path, const supine_mesh_load_options *options,
                               supine_mesh *mesh, supine_mesh_report *report, supine_error *error) {
  const supine_mesh_load_options chosen =
      options == NULL ? (supine_mesh_load_options){0} : *options;
  double scale = chosen.millimetres_per_unit == 0.0 ? 1.0 : chosen.millimetres_per_unit;
  SUPINE_REFUSE_IF(!(scale > 0.0) || !isfinite(scale), error, SUPINE_ERROR_ARGUMENT,
                   "%s: %g mm per unit is not a positive number", path, scale);
  SUPINE_ARENA arena = {0};
  SUPINE_FREED_BY(supine_mesh_free) supine_mesh loaded = {0};
  supine_mesh_report found = {0};
  mesh_file file = {.path = path};
  mesh_reader *reader = NULL;
  if (chosen.arrays != NULL) {
    SUPINE_TRY(copy_arrays(path, chosen.arrays, &loaded, error));
  } else {
    SUPINE_TRY(read_file(&file, &arena, &reader, error));
    SUPINE_TRY(reader(&file, &loaded, &found.degenerate_faces, error));
  }
  if (chosen.millimetres_per_unit == 0.0 && file.millimetres > 0.0) {
    scale = file.millimetres;
  }
  SUPINE_TRY(choose_axes(&file, chosen.axes, &found, error));
  SUPINE_TRY(convert(path, scale, found.axes, &loaded, error));
  if (supine_io_weld(&loaded, &found) != SUPINE_OK) {
    return supine_error_memory(error, "%zu vertices of %s", loaded.vertex_count, path);
  }
  SUPINE_REFUSE_IF(loaded.triangle_count == 0, error, SUPINE_ERROR_MESH,
                   "%s: no triangles; give a surface, not points or lines", path);
  *mesh = loaded;
  loaded = (supine_mesh){0};
  if (report != NULL) {
    *report = found;
  }
  return SUPINE_OK;
}
