/* SPDX-License-Identifier: MIT */
/** @file
 * Rigid parts: ranges of vertices of one lung that move without changing their shape (see
 * supine_deform). */
#ifndef SUPINE_RIGID_H
#define SUPINE_RIGID_H

#include "runtime/internal.h"

/** Find the rotation that best takes points p to points x, by least squares [Horn 1987, J Opt Soc
 * Am A 4(4)].
 * @param h         [3, 3] sum of p_a x_b over the points, both less their means
 * @param rotation  [3, 3] by rows, written */
void supine_rigid_rotation(const double h[3][3], double rotation[9]);

/** The rigid motion x = R (p - mean p) + mean x of a part, where p are its reference positions and
 * x its positions deformed without regard to rigidity. Zero-initialise. */
typedef struct supine_rigid_motion {
  double count;          /**< number of vertices added */
  double from[3], to[3]; /**< sums of p and x; after supine_rigid_finish, their means, mm */
  double cross[3][3];    /**< sum of p_a x_b; after supine_rigid_finish, less the means */
  double rotation[9];    /**< R by rows, set by supine_rigid_finish */
} supine_rigid_motion;

/** Add `count` vertices with positions p and x [count, 3] to the sums. */
void supine_rigid_add(supine_rigid_motion *motion, const float *p, const float *x, size_t count);
/** Find the means and the rotation R from the sums over all vertices. */
void supine_rigid_finish(supine_rigid_motion *motion);
/** Compute coordinate `axis` of the position to which the motion takes p. */
double supine_rigid_move(const supine_rigid_motion *motion, const float *p, size_t axis);

/** Replace the positions of rigid parts in `xyz` [N, 3] by the rigid motion of the reference
 * positions that fits them best. */
void supine_rigid_restore(const supine_basis *basis, float *xyz);

#endif
