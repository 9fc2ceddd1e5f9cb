/* SPDX-License-Identifier: MIT */
/* Create, copy and free a surface. */
#include <stdlib.h>

#include "mesh/mesh.h"

void supine_mesh_free(supine_mesh *mesh) {
  free(mesh->vertices);
  free(mesh->triangles);
  *mesh = (supine_mesh){0};
}
