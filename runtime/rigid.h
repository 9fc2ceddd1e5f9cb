/* SPDX-License-Identifier: MIT */
/** @file
 * Rigid parts: ranges of vertices of one lung that keep their shape (supine_deform). */
#ifndef SUPINE_RIGID_H
#define SUPINE_RIGID_H

#include "runtime/internal.h"

/** Find the rotation that best maps points p to points x, by least squares [Horn 1987, J Opt Soc Am
 * A 4(4)]. The means of p and of x must be 0.
 * @param h         h[a][b] is the sum over all points of coordinate a of p times coordinate b of x
 * @param rotation  [3, 3] by rows, written */
void supine_rigid_rotation(const double h[3][3], double rotation[9]);

/** The rigid motion of a part, R (p - mean of p) + mean of x. R is a rotation, p are the reference
 * positions of the part, and x the positions that it would have if it were not rigid.
 * Zero-initialise. */
typedef struct supine_rigid_motion {
  double count;          /**< number of vertices added */
  double from[3], to[3]; /**< sums, later means, of reference and deformed positions, mm */
  double cross[3][3];    /**< sum of reference coordinate [a] times deformed coordinate [b], mm^2 */
  double rotation[9];    /**< rotation R by rows, set by supine_rigid_finish */
} supine_rigid_motion;

/** Add vertices with reference positions p and deformed positions x, [count, 3], to a motion. */
void supine_rigid_add(supine_rigid_motion *motion, const float *p, const float *x, size_t count);
/** After all vertices were added, compute their mean positions and the rotation R. */
void supine_rigid_finish(supine_rigid_motion *motion);
/** Move one point p rigidly, and return coordinate `axis` of the result, mm. */
double supine_rigid_move(const supine_rigid_motion *motion, const float *p, size_t axis);

/** Make the rigid parts keep their shape: in `xyz` [N, 3], mm, replace the positions of each part
 * by the rigid motion of its reference positions that fits the replaced positions best. */
void supine_rigid_restore(const supine_basis *basis, float *xyz);

#endif
