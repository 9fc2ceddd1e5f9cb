/* SPDX-License-Identifier: MIT */
/** @file
 * Rigid parts, which keep their size (see supine_deform): each range of vertices is in one lung. */
#ifndef SUPINE_RIGID_H
#define SUPINE_RIGID_H

#include "runtime/internal.h"

/** Find the rotation, rows, that takes points p to points x best [Horn 1987, J Opt Soc Am A 4(4)].
 * @param h  [3, 3] sum of p_a x_b, both counted from their means */
void supine_rigid_rotation(const double h[3][3], double rotation[9]);

/** Sums over the vertices of a part, p in the file and x after the field, then its motion
 * x = R (p - mean p) + mean x. Zeroed at first. */
typedef struct supine_rigid_motion {
  double count, from[3], to[3]; /**< means, at last */
  double cross[3][3], rotation[9];
} supine_rigid_motion;

void supine_rigid_add(supine_rigid_motion *motion, const float *p, const float *x, size_t count);
void supine_rigid_finish(supine_rigid_motion *motion);
/** Compute coordinate `axis` of where the motion takes p. */
double supine_rigid_move(const supine_rigid_motion *motion, const float *p, size_t axis);

/** Make the rigid parts of positions of every vertex [N, 3] rigid, wherever they come from. */
void supine_rigid_restore(const supine_basis *basis, float *xyz);

#endif
