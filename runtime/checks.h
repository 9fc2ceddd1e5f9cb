/* SPDX-License-Identifier: MIT */
/* Check the volumes of a state without refusing them. */
#ifndef SUPINE_RUNTIME_CHECKS_H
#define SUPINE_RUNTIME_CHECKS_H

#include <supine/runtime.h>

/* Number of rows of the tensor 'volume_range': directions of gravity (x, y, z) with components -1,
 * 0 and 1, x fastest. The row of (0, 0, 0) is not used. */
enum { SUPINE_RANGE_NODES = 27 };

/* Return whether the file has the tensor 'volume_range': the least and the largest volume of each
 * lung, mL, at which at most the share of triangles in the check `folds` turn over. */
bool supine_basis_has_range_of_volumes(const supine_basis *basis);

/* Return whether lungs can hold the volumes of a pose. If not, write to `wrong` what is wrong. */
bool supine_basis_can_hold(const supine_basis *basis, const supine_state *state,
                           const supine_pose *pose, char *wrong, size_t size);

#endif
