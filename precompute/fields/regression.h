/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Least-squares fit of functions of gravity and volume to the runs of a simulator:
 *
 *     u(g, t) = sum over lm, n of C_lm,n Y_lm(g) T_n(t)
 *
 *     g      direction of gravity
 *     t      volume of the lung, mapped to -1 to 1 over all that was simulated
 *     Y_lm   real spherical harmonics to degree `band`
 *     T_n    Chebyshev polynomials to degree `order`; order 0 fits gravity alone
 *
 * Each part of the surface (a lung) has volumes of its own, and therefore a matrix of its own. The
 * coefficients C are the product of its pseudo-inverse with the displacements of the runs. A term
 * is a pair (lm, n), with the index lm (order + 1) + n. */
#ifndef SUPINE_REGRESSION_H
#define SUPINE_REGRESSION_H

#include <stdbool.h>
#include <stddef.h>

#include "base/arena.h"

/** The runs of a simulator. */
typedef struct supine_runs {
  size_t count;
  size_t part_count;
  const double *gravity; /**< [count, 3] unit vectors */
  const double *volume;  /**< [part_count, count] t of each part in each run; not read at order 0 */
} supine_runs;

/** Sets of runs that are predicted from all others, such as all runs of one direction. */
typedef struct supine_run_groups {
  size_t count;
  const size_t *begin; /**< [count + 1] first run of each group in `run`, then its length */
  const size_t *run;
} supine_run_groups;

typedef struct supine_regression {
  size_t run_count;
  size_t part_count;
  size_t band;
  size_t order;
  size_t terms;     /**< (band + 1)^2 (order + 1) */
  double *values;   /**< [part_count, run_count, terms] each term in each run */
  double *pinv;     /**< [part_count, terms, run_count] pseudo-inverse of `values` */
  double condition; /**< largest condition number of `values` of a part */
} supine_regression;

/** Fit the terms to runs. There must be at least as many runs as terms.
 * @param memory  holds the arrays of the regression
 * @retval SUPINE_ERROR_NUMERICAL  LAPACK found no singular values */
supine_status supine_fields_regression_create(const supine_runs *runs, size_t band, size_t order,
                                              supine_arena *memory, supine_regression *made);

/** Return whether the runs determine the terms: the condition number is small, and each group of
 * runs can be left out. */
bool supine_fields_regression_is_determined(const supine_regression *regression,
                                            const supine_run_groups *groups);

/** Predict each run from all others, and compute the squared errors.
 * @param square  [run_count] written: squared error of each run, mm^2, of all parts
 * @retval SUPINE_ERROR_NUMERICAL  a run has no residual whatever its displacements */
supine_status supine_fields_regression_leave_each(const supine_regression *regression,
                                                  const double *gram, double *square);

/** Predict the runs of a group from all other runs, in every part, and compute the squared errors.
 * @param gram      [part_count, run_count, run_count] scalar products of the displacements of any
 *   two runs in each part, mm^2
 * @param modes     number of principal modes of the fit to which it is compressed before it
 *   predicts; 0 for none
 * @param residual  [part_count, runs of the group, run_count] written: the error of a run, true
 *   minus predicted, is the sum of these times the displacements of all runs
 * @param square    [runs of the group] written: squared error of each run, mm^2, of all parts */
supine_status supine_fields_regression_predict(const supine_regression *regression,
                                               const supine_run_groups *groups, size_t group,
                                               const double *gram, size_t modes, double *residual,
                                               double *square);

#endif
