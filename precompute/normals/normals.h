/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Normals of every deformed surface as a few functions of posture and volume.
 *
 * The triangles' area vectors around a vertex sum to a polynomial of the weights w and the lung's
 * gains. Its component along axis c, with a and b the gains of the next two axes (cyclically), is
 *
 *     N_ic = A_ic . phi_c        phi_c = (1, a w_k, b w_k, a b w_k w_l (k <= l))
 *
 * so that over all postures and volumes it lies in a space of few dimensions. Each lung has Q modes
 * n_j,
 *
 *     N_i ~ |N_i(0)| sum over j of n_ij v_j        v_j = sum over c of V_jc . phi_c
 *
 * best for angles: all vertices count alike, whatever their area, and so do all states. */
#ifndef SUPINE_NORMALS_H
#define SUPINE_NORMALS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <supine/runtime.h>

/** The surface and the field that a basis file will hold. */
typedef struct supine_normals_surface {
  size_t vertex_count, triangle_count, lung_count, mode_count, band;
  const size_t *lung_begin;  /**< [G + 1] */
  const float *vertices;     /**< [N, 3] */
  const uint32_t *triangles; /**< [M, 3] */
  const float *directions;   /**< [N, 3]; NULL: a vector field */
  const float *coefficients; /**< [N, K] or [N, 3, K] */
  const double *modes;       /**< [K, (band + 1)^2] */
  const double *resting;     /**< [G, 9] mL beyond the surface at rest, harmonics; NULL: not known,
                                and the volume's forms are not used */
  const double *linear;      /**< [G, 3, K] */
  const double *quadratic;   /**< [G, 3, K, K] */
  const double *cubic;       /**< [G, K, K, K] */
  double bend[3];            /**< see supine_volume_bend */
} supine_normals_surface;

/** The modes of the normals of every vertex. */
typedef struct supine_normals_modes {
  size_t count;    /**< Q; 0: none were made */
  int16_t *modes;  /**< [N, 3, Q] n, in units that `weights` contain */
  double *weights; /**< [G, Q, 3, 1 + 2 K + K (K + 1) / 2] V */
  double range[2]; /**< least and largest volume of the states, mL beyond the file's surface; where
                      no rest is known, least and largest of the largest displacement, mm */
  double mean;     /**< angle, degrees, from the exact normals, over vertices and states that the
                      modes were not found from */
  double p999;     /**< 99.9th percentile of that angle */
} supine_normals_modes;

/** Find the fewest modes, SUPINE_NORMALS_FEW to SUPINE_NORMALS_MOST in steps of 3 (three share a
 * word in an open basis), that err by at most 0.08 degrees in the mean and 0.8 in the 99.9th
 * percentile, as judged on up to 4097 vertices of each lung; the most where none do. None are made
 * of a field with more than SUPINE_NORMALS_FIELD_MAX modes. Cost: the surface is deformed some 50
 * times. Uses all cores.
 * @retval SUPINE_ERROR_NUMERICAL  an eigenvalue problem failed
 * @retval SUPINE_ERROR_MEMORY */
enum { SUPINE_NORMALS_FEW = 6, SUPINE_NORMALS_MOST = 24, SUPINE_NORMALS_FIELD_MAX = 24 };
supine_status supine_normals_modes_create(const supine_normals_surface *surface,
                                          supine_normals_modes *made, supine_error *error);

void supine_normals_modes_free(supine_normals_modes *modes);

#endif
