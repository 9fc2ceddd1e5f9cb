/* SPDX-License-Identifier: GPL-3.0-or-later */
/* What commands that read a basis share. */
#include <stdlib.h>
#include <string.h>

#include "runtime/options/basis_input.h"

supine_status supine_options_basis_rest_mesh(const supine_basis *basis, supine_mesh *mesh) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  const float *vertices = supine_basis_vertices(basis);
  supine_mesh made = {.vertex_count = info->vertex_count, .triangle_count = info->triangle_count};
  made.vertices = malloc(3 * info->vertex_count * sizeof *made.vertices);
  made.triangles = malloc(3 * info->triangle_count * sizeof *made.triangles);
  if (made.vertices == NULL || made.triangles == NULL) {
    supine_mesh_free(&made);
    return SUPINE_ERROR_MEMORY;
  }
  for (size_t i = 0; i < 3 * info->vertex_count; ++i) {
    made.vertices[i] = (double)vertices[i];
  }
  memcpy(made.triangles, supine_basis_triangles(basis),
         3 * info->triangle_count * sizeof *made.triangles);
  *mesh = made;
  return SUPINE_OK;
}
