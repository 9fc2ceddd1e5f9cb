/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Find the normals of every deformed surface as a few functions of posture and volume.
 *
 * The triangles' area vectors around a vertex sum to a polynomial of the weights w and the lung's
 * gains. Its component along axis c, with a and b the gains of the next two axes (cyclically), is
 *
 *     N_ic = A_ic . phi_c        phi_c = (1, a w_k, b w_k, a b w_k w_l (k <= l))
 *
 * so over all postures and volumes it lies in a space of few dimensions. Each lung has Q modes n_j,
 *
 *     N_i ~ |N_i(0)| sum over j of n_ij v_j        v_j = sum over c of V_jc . phi_c
 *
 * fitted to minimise angles: all vertices have the same weight, whatever their area, and so do all
 * states. N_i(0) is the normal of the reference surface. */
#ifndef SUPINE_NORMALS_H
#define SUPINE_NORMALS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <supine/runtime.h>

#include "precompute/projection/projection.h"

/** The surface and the field that a basis file will hold. */
typedef struct supine_normals_surface {
  size_t vertex_count, triangle_count, lung_count;
  const size_t *lung_begin;  /**< [G + 1] first vertex of each lung, then N */
  const float *vertices;     /**< [N, 3] reference surface, mm */
  const uint32_t *triangles; /**< [M, 3] indices of vertices */
  const float *directions;   /**< [N, 3] directions of displacement, mm; NULL: a vector field */
  const supine_compression *field;  /**< coefficients [N, K] or [N, 3, K], and their modes */
  const double *resting;            /**< [G, 9] harmonics of the volume at rest, mL beyond the
                                       reference surface; NULL: unknown, and `forms` is not used */
  const supine_volume_forms *forms; /**< volume forms of the field */
  double bend[3]; /**< bend of the path from full inflation to rest (supine_volume_bend) */
} supine_normals_surface;

/** The modes of every vertex's normal, and their error. */
typedef struct supine_normals_modes {
  size_t count;    /**< number of modes Q; 0: no normals */
  int16_t *modes;  /**< [N, 3, Q] n_ij as integers, in units that `weights` include */
  double *weights; /**< [G, Q, 3, 1 + 2 K + K (K + 1) / 2] V_jc */
  double range[2]; /**< least and largest volume of the states, mL beyond the reference surface; if
                      rest is unknown, signed largest displacements, mm */
  double mean;     /**< mean angle from the exact normals, degrees, over held-out vertices and
                      states */
  double p999;     /**< 99.9th percentile of that angle, degrees */
} supine_normals_modes;

/** Find the fewest modes, SUPINE_NORMALS_FEW to SUPINE_NORMALS_MOST in steps of 3 (three share a
 * word in an open basis), with a mean error of at most 0.08 degrees and a 99.9th percentile of at
 * most 0.8, measured on up to 4096 vertices of each lung; the largest number if none achieves that.
 * A field with more than SUPINE_NORMALS_FIELD_MAX modes gets no modes of normals. Cost: the surface
 * is deformed about 50 times. Uses all cores.
 * @param made  release with supine_normals_modes_free
 * @retval SUPINE_ERROR_NUMERICAL  an eigenvalue problem failed
 * @retval SUPINE_ERROR_MEMORY */
enum { SUPINE_NORMALS_FEW = 6, SUPINE_NORMALS_MOST = 24, SUPINE_NORMALS_FIELD_MAX = 24 };
supine_status supine_normals_modes_create(const supine_normals_surface *surface,
                                          supine_normals_modes *made, supine_error *error);

void supine_normals_modes_free(supine_normals_modes *modes);

#endif
