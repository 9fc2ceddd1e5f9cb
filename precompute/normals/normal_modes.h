/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Approximate the normals of every deformed surface by a few functions of posture and volume.
 *
 * The normal N_i of vertex i is the sum of the area vectors of its triangles. It is a polynomial of
 * the weights w_k of the field's modes and of the three gains of the lung. Let a and b be the gains
 * of the two axes that follow axis c in cyclic order. The component of N_i along axis c is the
 * scalar product of coefficients A_ic, which depend on the vertex, and monomials phi_c, which
 * depend on the state:
 *
 *     N_ic = A_ic . phi_c        phi_c = (1, a w_k, b w_k, a b w_k w_l for k <= l)
 *
 * The normals of each lung are approximated by Q modes n_j, whose weights v_j depend on the state.
 * N_i(0) is the normal on the reference surface:
 *
 *     N_i ~ |N_i(0)| sum over j of n_ij v_j        v_j = sum over c of V_jc . phi_c
 *
 * All vertices and all states have the same weight in the fit of n and V. */
#ifndef SUPINE_NORMALS_H
#define SUPINE_NORMALS_H

#include <stddef.h>
#include <stdint.h>

#include <supine/runtime.h>

#include "precompute/projection/projection.h"

/** The surface and the field that a basis file will hold. */
typedef struct supine_normals_surface {
  size_t vertex_count, triangle_count, lung_count;
  const size_t *lung_begin;  /**< [G + 1] first vertex of each lung; the last entry is N */
  const float *vertices;     /**< [N, 3] reference surface, mm */
  const uint32_t *triangles; /**< [M, 3] indices of vertices */
  const float *directions;   /**< [N, 3] displacement directions, mm; NULL for vector fields */
  const supine_compression *field;
  /** [G, 9] volume of each lung at rest minus that of its reference surface, mL, as harmonics of
   * the direction of gravity; NULL if rest is unknown */
  const double *resting;
  const supine_volume_forms *forms; /**< volume forms of `field`; not used if `resting` is NULL */
  double bend[3]; /**< bend of the path from full inflation to rest (supine_volume_bend) */
} supine_normals_surface;

/** The modes of every vertex's normal, and their error. */
typedef struct supine_normals_modes {
  size_t count;    /**< number Q of modes; may be 0 */
  int16_t *modes;  /**< [N, 3, Q] modes scaled to integers; `weights` include the inverse scale */
  double *weights; /**< [lungs, Q, 3, 1 + 2 K + K (K + 1) / 2] V_jc; the field has K modes */
  /** Range of the sampled states. If rest is known: volume of all lungs minus that of the reference
   * surface, mL. If not: largest displacement of a vertex, mm, with the sign of the gain. */
  double range[2];
  double mean; /**< mean angle between exact and approximate normals at held-out vertices and
                  states, degrees */
  double p999; /**< 99.9th percentile of the angle between exact and approximate normals, degrees */
} supine_normals_modes;

/** Find the smallest number of modes whose angular error, measured at up to 4096 vertices of each
 * lung, has a mean of at most 0.08 degrees and a 99.9th percentile of at most 0.8 degrees. Numbers
 * from SUPINE_NORMALS_FEW to SUPINE_NORMALS_MOST are tried in steps of 3, because three modes
 * share a word in an open basis. If no number suffices, the last one is kept. A field with more
 * than SUPINE_NORMALS_FIELD_MAX modes gets no modes of normals. Cost: the surface is deformed
 * about 50 times. Uses all cores.
 * @param made  release with supine_normals_modes_free
 * @retval SUPINE_ERROR_NUMERICAL  an eigenvalue problem failed
 * @retval SUPINE_ERROR_MEMORY */
enum { SUPINE_NORMALS_FEW = 6, SUPINE_NORMALS_MOST = 24, SUPINE_NORMALS_FIELD_MAX = 24 };
supine_status supine_normals_modes_create(const supine_normals_surface *surface,
                                          supine_normals_modes *made, supine_error *error);

void supine_normals_modes_free(supine_normals_modes *modes);

#endif
