/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Open a basis and copy its surface, for the commands that read one. */
#ifndef SUPINE_BASIS_INPUT_H
#define SUPINE_BASIS_INPUT_H

#include "mesh/mesh.h"
#include <supine/runtime.h>

#include "program/options/command.h"

/* --as-scanned, into a bool: write outputs in the axes and units of the scan. */
extern const supine_option supine_options_as_scanned[];

/* Open a basis without its stored normals: commands compute normals from the triangles. */
supine_status supine_options_basis_open(const char *path, supine_storage storage,
                                        supine_basis **basis, supine_error *error);

/* Set the axes and unit of `save` to those of the scan where `wanted`.
 * @retval SUPINE_ERROR_FORMAT  the basis does not state them */
supine_status supine_options_basis_frame(const supine_basis *basis, bool wanted,
                                         supine_mesh_save_options *save, supine_error *error);

/* Compute the positions of a pose as doubles [N, 3], which the caller frees; NULL: no memory. */
double *supine_options_basis_positions(const supine_basis *basis, const supine_pose *pose);

/* Copy the reference surface into a mesh; release it with supine_mesh_free.
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_options_basis_rest_mesh(const supine_basis *basis, supine_mesh *mesh);

#endif
