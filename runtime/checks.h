/* SPDX-License-Identifier: MIT */
/* What is known of the check of volumes (supine_basis_check). */
#ifndef SUPINE_RUNTIME_CHECKS_H
#define SUPINE_RUNTIME_CHECKS_H

#include <supine/runtime.h>

/* Number of rows of the tensor 'volume_range': directions of gravity (x, y, z) with components -1,
 * 0 and 1, x fastest. The row of (0, 0, 0) is not used. */
enum { SUPINE_RANGE_NODES = 27 };

/* Return whether the file has the tensor 'volume_range': the least and the largest volume of each
 * lung, mL, at which at most the share of triangles in the check `folds` turn over. */
bool supine_basis_has_range_of_volumes(const supine_basis *basis);

/* Return whether the basis was opened with supine_basis_options.allow_folds. */
bool supine_basis_allows_folds(const supine_basis *basis);

#endif
