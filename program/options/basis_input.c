/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Open a basis and copy its surface, for the commands that read one. */
#include <stdlib.h>
#include <string.h>

#include "program/options/basis_input.h"

const supine_option supine_options_as_scanned[] = {
    {"as-scanned", 0, NULL,
     "write in the axes and units of the scan, to overlay it; default LPS and mm",
     .kind = SUPINE_OPTION_FLAG, .size = sizeof(bool)},
    {.name = NULL}};

supine_status supine_options_basis_open(const char *path, supine_storage storage,
                                        supine_basis **basis, supine_error *error) {
  const supine_basis_options options = {sizeof options, .storage = storage,
                                        .without_normals = true};
  return supine_basis_open_with(path, &options, basis, error);
}

supine_status supine_options_basis_frame(const supine_basis *basis, bool wanted,
                                         supine_mesh_save_options *save, supine_error *error) {
  const char *axes = supine_basis_metadata(basis, "scan_axes");
  const char *unit = supine_basis_metadata(basis, "scan_unit_mm");
  if (wanted &&
      (axes == NULL || unit == NULL ||
       !supine_options_parse_number(unit, &save->millimetres_per_unit) ||
       !(save->millimetres_per_unit > 0.0) || !supine_mesh_axes_parse(axes, &save->axes))) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "the basis does not state the axes and units of its scan: leave "
                            "--as-scanned out, or make the basis again from the scan");
  }
  return SUPINE_OK;
}

/* Convert [N, 3] to doubles; NULL: no memory. */
static double *to_doubles(const supine_basis *basis, const float *xyz) {
  const size_t count = 3 * supine_basis_get_info(basis)->vertex_count;
  double *converted = malloc(count * sizeof *converted);
  for (size_t i = 0; converted != NULL && i < count; ++i) {
    converted[i] = (double)xyz[i];
  }
  return converted;
}

double *supine_options_basis_positions(const supine_basis *basis, const supine_pose *pose) {
  float *xyz = malloc(3 * supine_basis_get_info(basis)->vertex_count * sizeof *xyz);
  double *positions = NULL;
  if (xyz != NULL) {
    supine_deform(basis, pose, xyz);
    positions = to_doubles(basis, xyz);
  }
  free(xyz);
  return positions;
}

supine_status supine_options_basis_rest_mesh(const supine_basis *basis, supine_mesh *mesh) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  const size_t bytes = 3 * info->triangle_count * sizeof *mesh->triangles;
  supine_mesh made = {.vertex_count = info->vertex_count,
                      .vertices = to_doubles(basis, supine_basis_vertices(basis)),
                      .triangle_count = info->triangle_count,
                      .triangles = malloc(bytes)};
  if (made.vertices == NULL || made.triangles == NULL) {
    supine_mesh_free(&made);
    return SUPINE_ERROR_MEMORY;
  }
  memcpy(made.triangles, supine_basis_triangles(basis), bytes);
  *mesh = made;
  return SUPINE_OK;
}
