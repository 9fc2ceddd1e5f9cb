/* SPDX-License-Identifier: MIT */
/* Load a file into a welded surface in millimetres, LPS. */
#include <math.h>
#include <stdlib.h>

#include "mesh/io/read.h"

static supine_status read_surface(mesh_file *file, supine_mesh *mesh, size_t *dropped,
                                  supine_error *error) {
  switch (file->format) {
  case MESH_FORMAT_PLY:
    return supine_mesh_read_ply(file, mesh, dropped, error);
  case MESH_FORMAT_VTP:
    return supine_mesh_read_vtp(file, mesh, dropped, error);
  case MESH_FORMAT_STL:
    return supine_mesh_read_stl(file, mesh, error);
  case MESH_FORMAT_OBJ:
    if (supine_mesh_guard_obj(file, error) != SUPINE_OK) {
      return SUPINE_ERROR_FORMAT;
    }
    break;
  case MESH_FORMAT_OTHER:
    break;
  }
  return supine_mesh_import(file, mesh, dropped, error);
}

static supine_status choose_axes(const mesh_file *file, supine_axes asked,
                                 supine_mesh_report *report, supine_error *error) {
  if (asked != SUPINE_AXES_AUTO) {
    report->axes = asked;
    return SUPINE_OK;
  }
  if (file->tagged && file->space == SUPINE_AXES_AUTO) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "%s: its SPACE tag is not three letters such as LPS or RAS; name "
                            "them, as --axes LPS",
                            file->path);
  }
  report->axes = file->tagged ? file->space : SUPINE_AXES_LPS;
  report->axes_from_tag = file->tagged;
  report->comment_names_ras = !file->tagged && file->mentions_ras;
  return SUPINE_OK;
}

/* Largest coordinate, mm, that single precision resolves to 1 mm. */
static const double farthest = 1e7;

/* Convert to millimetres and LPS. */
static supine_status convert(const char *path, double scale, supine_axes axes, supine_mesh *mesh,
                             supine_error *error) {
  for (size_t i = 0; i < mesh->vertex_count; ++i) {
    double *vertex = mesh->vertices + 3 * i;
    const double largest = fmax(fabs(vertex[0]), fmax(fabs(vertex[1]), fabs(vertex[2])));
    if (!isfinite(vertex[0]) || !isfinite(vertex[1]) || !isfinite(vertex[2])) {
      return supine_error_set(error, SUPINE_ERROR_MESH,
                              "%s: vertex %zu of %zu has a coordinate that is not finite; repair "
                              "the mesh",
                              path, i, mesh->vertex_count);
    }
    if (!(largest * scale <= farthest)) {
      return supine_error_set(error, SUPINE_ERROR_MESH,
                              "%s: vertex %zu of %zu lies %.3g mm from the origin; repair the "
                              "mesh, or give its --units",
                              path, i, mesh->vertex_count, largest * scale);
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
  const double scale = chosen.millimetres_per_unit == 0.0 ? 1.0 : chosen.millimetres_per_unit;
  if (!(scale > 0.0) || !isfinite(scale)) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "%s: %g mm per unit is not a positive number; correct --units", path,
                            scale);
  }
  supine_mesh loaded = {0};
  supine_mesh_report found = {0};
  mesh_file file;
  supine_status status = supine_mesh_file_read(path, &file, error);
  if (status != SUPINE_OK) {
    return status;
  }
  if ((status = read_surface(&file, &loaded, &found.degenerate_faces, error)) != SUPINE_OK ||
      (status = choose_axes(&file, chosen.axes, &found, error)) != SUPINE_OK ||
      (status = convert(path, scale, found.axes, &loaded, error)) != SUPINE_OK) {
    goto cleanup;
  }
  found.file_vertices = loaded.vertex_count;
  found.file_faces = loaded.triangle_count + found.degenerate_faces;
  status = supine_mesh_weld(&loaded, &found);
  if (status != SUPINE_OK) {
    (void)supine_error_set(error, status, "%s: out of memory", path);
    goto cleanup;
  }
  if (loaded.triangle_count == 0) {
    status = supine_error_set(error, SUPINE_ERROR_MESH,
                              "%s: no triangles (%zu vertices, %zu faces in the file); give a "
                              "surface, not points or lines",
                              path, found.file_vertices, found.file_faces);
    goto cleanup;
  }
  *mesh = loaded;
  loaded = (supine_mesh){0};
  if (report != NULL) {
    *report = found;
  }

cleanup:
  supine_mesh_free(&loaded);
  supine_mesh_file_free(&file);
  return status;
}
