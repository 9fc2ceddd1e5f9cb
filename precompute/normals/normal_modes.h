/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Approximate the normals of the deformed surface by a few functions of posture and volume.
 *
 * The displacement of vertex i along axis c is s_c sum over k of w_k m_ikc, where m_k are the modes
 * of the displacement field, w_k their weights, and s_c the gain of its lung for axis c. The normal
 * N_i is the sum of the area vectors of the triangles at vertex i. Its component along axis c is a
 * scalar product of coefficients A_ic of the vertex and monomials phi_c of the weights and gains.
 * With the gains a and b of the two axes that follow axis c in cyclic order,
 *
 *     N_ic = A_ic . phi_c        phi_c = (1, a w_k, b w_k, a b w_k w_l for k <= l)
 *
 * The normals of each lung are approximated by a few modes n_j of their own. Their weights v_j have
 * coefficients V_jc. N_i(0) is the normal on the reference surface:
 *
 *     N_i ~ |N_i(0)| sum over j of n_ij v_j        v_j = sum over c of V_jc . phi_c
 *
 * The fit of n and V gives the same weight to all vertices and to all sampled states. */
#ifndef SUPINE_NORMALS_H
#define SUPINE_NORMALS_H

#include <stddef.h>
#include <stdint.h>

#include <supine/runtime.h>

#include "base/arena.h"
#include "precompute/projection/projection.h"

/** The surface and the displacement field of a basis file. */
typedef struct supine_normals_surface {
  const supine_lungs *lungs; /**< triangles, and the vertices of each lung */
  const float *vertices;     /**< [N, 3] positions on the reference surface, mm */
  supine_rows_kind kind;     /**< kind of the rows of `field` */
  const float *directions;   /**< SCALAR: [N, 3] displacement of each vertex per unit force, mm */
  const supine_compression *field;
  /** [lungs, 9] resting volume (FRC) minus the volume of the reference surface, mL: coefficients of
   * spherical harmonics of the direction of gravity, to degree 2; NULL if unknown */
  const double *resting;
  const supine_volume_forms *forms; /**< lung volumes as functions of mode weights and gains; unused
                                       if `resting` is NULL */
  const double *bend; /**< [3] curvature of the vertices' paths (supine_volume_bend) */
} supine_normals_surface;

/** Modes from which vertex normals are computed, and the error of these normals. */
typedef struct supine_normals_modes {
  size_t count;  /**< number of modes; may be 0 */
  int8_t *modes; /**< [N, 3, count + 1] scaled to integers (supine_basis_info.normals);
                    `weights` include the inverse scale; NULL without modes */
  /** [lungs, count, 3, monomials] coefficients V_jc of each mode's weight (top of this file). */
  double *weights;
  /** Least and largest volume of all lungs, minus that of the reference surface, among the states
   * from which the modes are found, mL. If the resting volume (FRC) is unknown: displacement of the
   * vertex that moves most, mm, negative if all displacements are reversed. */
  double range[2];
  /** Mean angle between exact and approximate normals at held-out vertices and states, degrees. */
  double mean;
  double p999; /**< 99.9th percentile of the angle between exact and approximate normals, degrees */
} supine_normals_modes;

enum { SUPINE_NORMALS_FEW = 6, SUPINE_NORMALS_MOST = 24 }; /**< least and most modes of normals */
enum { SUPINE_NORMALS_FIELD_MAX = 24 }; /**< displacement fields with more modes get no normals */

/** Find modes of the normals: the smallest number with a mean angular error of at most 0.08 degrees
 * and a 99.9th percentile of at most 0.8 degrees, or the largest number tried. Numbers are tried in
 * steps of 3, because at run time three modes share a 32-bit word. For a displacement field with
 * more than SUPINE_NORMALS_FIELD_MAX modes, made->count is 0.
 * Cost: the surface is deformed about 50 times. Uses all cores.
 * @param arena  takes the arrays of `made` */
supine_status supine_normals_modes_create(const supine_normals_surface *surface,
                                          supine_arena *arena, supine_normals_modes *made,
                                          supine_error *error);

#endif
