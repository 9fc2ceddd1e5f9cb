/* SPDX-License-Identifier: GPL-3.0-or-later */
/* What commands that read a basis share: its surface as a mesh. */
#ifndef SUPINE_BASIS_INPUT_H
#define SUPINE_BASIS_INPUT_H

#include "mesh/mesh.h"
#include <supine/runtime.h>

#include "runtime/options/command.h"

/* The rest surface as a mesh of its own. */
supine_status supine_options_basis_rest_mesh(const supine_basis *basis, supine_mesh *mesh);

#endif
