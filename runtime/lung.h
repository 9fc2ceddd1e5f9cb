/* SPDX-License-Identifier: MIT */
/* Which lung a vertex belongs to. */
#ifndef SUPINE_LUNG_H
#define SUPINE_LUNG_H

#include <supine/runtime.h>

/* Return the index of the lung that a vertex belongs to. */
size_t supine_basis_lung_of(const supine_basis_info *info, size_t vertex);

#endif
