/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Open a basis, and find the axes of its scan. */
#ifndef SUPINE_BASIS_INPUT_H
#define SUPINE_BASIS_INPUT_H

#include <stdio.h>

#include <supine/locate.h>
#include <supine/runtime.h>

#include "mesh/mesh.h"
#include "precompute/posed/posed.h"

#include "program/options/command.h"

/* Option table that holds only --as-scanned, which sets a bool. */
extern const supine_option supine_options_as_scanned[];

/* Open a basis without its stored normals, and check that its surface is closed. The caller must
 * close the basis even after a failure.
 * @param allow_folds  as supine_basis_options.allow_folds: --allow-folds */
supine_status supine_options_basis_open(const char *path, supine_storage storage, bool allow_folds,
                                        supine_basis **basis, supine_error *error);

/* Close *basis; for SUPINE_FREED_BY. */
void supine_options_basis_close(supine_basis **basis);

/* If `wanted` is true, set the axes and the unit of `save` to those of the scan. */
supine_status supine_options_basis_frame(const supine_basis *basis, bool wanted,
                                         supine_mesh_save_options *save, supine_error *error);

/* Write the name of a basis file without its folder and the ending .safetensors, as UTF-8. */
void supine_options_basis_title(const char *path, char *title, size_t size);

/* Return the metadata of a basis as a JSON object. */
json_t *supine_options_json_metadata(const supine_basis *basis);

#define SUPINE_EXPECTED_MEANING                                                                    \
  "3-D RMS; half of all points lie within 0.9 times this distance of their true position, 95 % "   \
  "within 1.8 times"
#define SUPINE_EXPECTED_SUPPORT                                                                    \
  "The expected error was measured on breaths in one posture; for a change of posture it is an "   \
  "extrapolation. 'supine info --all' lists its terms."

#endif
