/* SPDX-License-Identifier: GPL-3.0-or-later */
/* What commands that read a basis share: its rest surface, and volumes as the user gives them. */
#ifndef SUPINE_BASIS_INPUT_H
#define SUPINE_BASIS_INPUT_H

#include "mesh/mesh.h"
#include <supine/runtime.h>

#include "runtime/options/command.h"

/* The rest surface as a mesh of its own. */
supine_status supine_options_basis_rest_mesh(const supine_basis *basis, supine_mesh *mesh);

/* Name of a lung, "left" or "right" for bases of this program; else its number. */
void supine_options_basis_lung_name(const supine_basis *basis, size_t lung, char *text,
                                    size_t size);

/* Breath scales [lung_count] for a volume: "500", "left=200,right=300", or NULL for 500 mL; an
 * exit code. Lungs that are not named keep their resting volume. */
int supine_options_basis_volume_scales(const supine_basis *basis, const char *command,
                                       const double *weights, const char *volume, double *scales);

#endif
