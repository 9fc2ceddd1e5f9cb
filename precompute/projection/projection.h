/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * The field over orientation, projected on spherical harmonics:
 *
 *     C_i,lm = integral of F_i(g) Y_lm(g) over the sphere
 *
 * kept in factors, C = columns x functions: the linear route needs no more columns than the applied
 * force has, one right-hand side each. */
#ifndef SUPINE_PROJECTION_H
#define SUPINE_PROJECTION_H

#include "precompute/physics/model.h"
#include "precompute/physics/volume_forms.h"

/** A projected scalar field. */
typedef struct supine_projection {
  size_t vertex_count;
  size_t band;
  size_t rank;       /**< R */
  double *columns;   /**< [N, R] */
  double *functions; /**< [R, (band + 1)^2]; NULL where R = (band + 1)^2 and it is the identity */
  size_t solve_count;
  size_t iterations; /**< of the solve that took most */
  double residual;   /**< the largest */
} supine_projection;

void supine_projection_free(supine_projection *projection);

/** Reports progress from 0 to 1; returns false to stop the work. */
typedef bool supine_progress_function(void *context, double fraction);

/** The linear route: one solve for all columns of the force, and the quadrature of its functions of
 * gravity. Exact for laws with soften = 0.
 * @retval SUPINE_ERROR_ARGUMENT  soften is not 0, a band above SUPINE_SH_BAND_MAX, bad stiffness
 * @retval SUPINE_ERROR_MEMORY, SUPINE_ERROR_NUMERICAL */
supine_status supine_projection_linear(const supine_lungs *lungs, const supine_model *model,
                                       size_t band, supine_projection *projection,
                                       supine_error *error);

/** The same with a rule of latitudes x longitudes directions instead of the default, which is eight
 * times finer than the band. */
supine_status supine_projection_linear_rule(const supine_lungs *lungs, const supine_model *model,
                                            size_t band, size_t latitudes, size_t longitudes,
                                            supine_projection *projection, supine_error *error);

/** The sampled route: a full solve for every direction of a Gauss-Legendre x equispaced grid, and
 * the transform of every vertex's field. For any law. The columns that come back are the harmonics'
 * coefficients themselves; memory is one ring of fields and those, and solves side by side within
 * 600 MB, or eight directions where these alone take more.
 * @param progress  optional
 * @retval SUPINE_ERROR_INTERRUPTED  progress returned false
 * @retval SUPINE_ERROR_ARGUMENT, SUPINE_ERROR_MEMORY, SUPINE_ERROR_NUMERICAL */
supine_status supine_projection_sampled(const supine_lungs *lungs, const supine_model *model,
                                        size_t band, supine_progress_function *progress,
                                        void *context, supine_projection *projection,
                                        supine_error *error);

/** The smooth route: a full solve for each of some 100 directions, and a polynomial through them in
 * gravity over the lungs' extent along it, in which the field is analytic while over the sphere it
 * has kinks (smooth.c). Columns and functions as from the linear route, without what a grid folds
 * back; memory is the columns, the fields of 32 directions, and solves within the same 600 MB.
 * @param progress  optional
 * @retval SUPINE_ERROR_ARGUMENT  soften is too large for a polynomial (above some 2.5), a bad band
 * @retval SUPINE_ERROR_INTERRUPTED  progress returned false
 * @retval SUPINE_ERROR_MEMORY, SUPINE_ERROR_NUMERICAL */
supine_status supine_projection_smooth(const supine_lungs *lungs, const supine_model *model,
                                       size_t band, supine_progress_function *progress,
                                       void *context, supine_projection *projection,
                                       supine_error *error);

/** How many directions that solves for; 0: soften is too large. */
size_t supine_projection_smooth_directions(const supine_model *model);

/** A field compressed to K functions of orientation:
 * F_i(g) ~ sum over k of coefficients[i, k] sum over lm of modes[k, lm] Y_lm(g). */
typedef struct supine_compression {
  size_t vertex_count;
  size_t band;
  size_t mode_count;   /**< K */
  float *coefficients; /**< [N, K] */
  double *modes;       /**< [K, (band + 1)^2] */
  double *mix;         /**< [R, K]: coefficients = columns x mix */
} supine_compression;

void supine_projection_compression_free(supine_compression *compression);

/** The harmonics themselves as modes: K = (band + 1)^2, the paper's form.
 * @retval SUPINE_ERROR_ARGUMENT  more than SUPINE_MODES_MADE_MAX harmonics
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_projection_compress_harmonics(const supine_projection *projection,
                                                   supine_compression *compression,
                                                   supine_error *error);

/** The best functions of orientation: the leading right singular vectors of the weighted
 * coefficient matrix, from the Gram matrix of the columns.
 *
 * @param weight     [N] weight of each vertex's square, such as |d_i|^2; NULL: 1
 * @param mode_max   most modes, 1 to SUPINE_MODES_MADE_MAX; fewer come back where the matrix has
 * lower rank
 * @param singular   [mode_max] singular values of the modes that came back, falling, 0 beyond;
 * optional
 * @param total      sum of the squares of all singular values; optional
 * @retval SUPINE_ERROR_ARGUMENT, SUPINE_ERROR_MEMORY, SUPINE_ERROR_NUMERICAL (the field is zero) */
supine_status supine_projection_compress_modes(const supine_projection *projection,
                                               const double *weight, size_t mode_max,
                                               supine_compression *compression, double *singular,
                                               double *total, supine_error *error);

/** Keeps the first `count` modes of a compression whose projection had `rank` columns. */
void supine_projection_compression_truncate(supine_compression *compression, size_t rank,
                                            size_t count);

#endif
