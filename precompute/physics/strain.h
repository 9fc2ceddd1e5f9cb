/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Displacements of tissue whose expandability a varies, if force spreads over a smoothing length.
 * Twice as expandable tissue expands twice as much. It does not move twice as far, as its
 * neighbours carry it. From the displacement v of uniform tissue, find the u that minimises
 *
 *     sum over edges ij of w_ij |(u_i - u_j) - a_ij (v_i - v_j)|^2 + sum over i of e_i |u_i -
 * v_i|^2
 *
 *     w_ij  1 / length of the edge in the scan, at least 0.5 mm
 *     a_ij  mean of a_i and a_j; a has the geometric mean 1 over all lungs, except for lesions
 *     e_i   sum of the lengths of the edges at vertex i / (1 m)^2; it holds the mean displacement
 *
 * u is linear in v and in a. Where a is 1, u is v. */
#ifndef SUPINE_STRAIN_H
#define SUPINE_STRAIN_H

#include "precompute/lungs/lungs.h"

/** The equations for one scan, factorised at the first use. Not thread-safe. */
typedef struct supine_strain supine_strain;

/** Set up the equations with the edges of the lungs' surface.
 * @param lungs      must outlive `strain`; its vertices may move
 * @param stiffness  [vertices] 1 / a up to a factor, or NULL for 1
 * @param lesions    [vertices] factors on the stiffness in lesions, or NULL
 * @param strain     written; release with supine_physics_strain_destroy, also after an error */
supine_status supine_physics_strain_create(const supine_lungs *lungs, const double *stiffness,
                                           const double *lesions, supine_strain **strain,
                                           supine_error *error);
void supine_physics_strain_destroy(supine_strain *strain);

/** Replace displacements of uniform tissue, in place.
 * @param expandability  [vertices] a, or NULL for that of supine_physics_strain_create
 * @param displacements  [vertices, count] `count` coordinates of displacements, mm */
supine_status supine_physics_strain_apply(supine_strain *strain, const double *expandability,
                                          size_t count, double *displacements, supine_error *error);

#endif
