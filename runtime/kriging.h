/* SPDX-License-Identifier: MIT */
/** @file
 * Kriging of the residuals of a displacement law at observed points.
 *
 * The residual y_j of point j is its observed position minus the law's position, mm. It is modelled
 * as
 *
 *     y_j = t + b v_j + r x (p_j - c) + g(p_j) + noise
 *
 * with three unknown terms: a translation t, a change b of the volume, and a small rotation r about
 * the centre c. b counts prior standard deviations of the volume, v_j is the displacement for
 * b = 1, and p_j the position in the scan. g is a random field. On each axis, its covariance, mm^2,
 * is
 *
 *     cov(g(p_i), g(p_j)) = (s / 3) sqrt(|u_i| |u_j|) q (1 + a) exp(-a)
 *     a = sqrt(3) |p_i - p_j| / length;  q = 1 within a lung, `across` between two lungs
 *
 * with the displacements u_i and u_j from the scan and the sill s. All three axes share one n x n
 * covariance matrix of the n points. No function allocates; any number of threads may predict from
 * one fit.
 *
 * The covariance is the Matern covariance of order 3/2 (Rasmussen & Williams, Gaussian Processes
 * for Machine Learning, 2006, equation 4.17), and the fit is universal kriging (section 2.7). */
#ifndef SUPINE_KRIGING_H
#define SUPINE_KRIGING_H

#include <stdbool.h>
#include <stddef.h>

#include <supine/status.h>

enum {
  SUPINE_KRIGING_POINTS_MAX = 300,
  SUPINE_KRIGING_TERMS = 7,   /**< translation at 0 to 2, volume at 3, rotation at 4 to 6 */
  SUPINE_KRIGING_COLUMNS = 10 /**< one column of 1, and three each of v, p - c and y */
};

typedef struct supine_kriging_model {
  double sill;   /**< sill s: 3-D variance of the random field g per mm of displacement, mm */
  double length; /**< correlation length of the random field, mm */
  double across; /**< correlation between points of two lungs, 0 to 1 */
  double least;  /**< lower bound on the length of a displacement, mm */
} supine_kriging_model;

/** Model of full breaths of 15 patients: sill 6 mm, length 90 mm, across 1/3, least 2 mm. */
extern const supine_kriging_model supine_kriging_default;

typedef struct supine_kriging_point {
  double position[3]; /**< p: position in the scan, mm */
  double volume[3]; /**< v: displacement if the volume grows by one prior standard deviation, mm */
  double residual[3]; /**< y: observed position minus the law's position, mm */
  double size;        /**< |u|: length of the displacement, mm */
  double noise;       /**< standard deviation of the observed position on each axis, mm, above 0 */
  size_t lung;
} supine_kriging_point;

/** The model, and the terms that are unknown in addition to the translation. */
typedef struct supine_kriging_options {
  supine_kriging_model model;
  bool volume, rotation;
  double volume_mean; /**< prior mean of the change b of the volume */
} supine_kriging_options;

typedef struct supine_kriging {
  supine_kriging_model model;
  const supine_kriging_point *points; /**< [count], owned by the caller */
  size_t count;                       /**< number n of points */
  double centre[3];                   /**< c, mean position of the points, mm */
  double *factor;   /**< [n, n] lower triangle L, where L L' is the covariance of the points */
  double *whitened; /**< [SUPINE_KRIGING_COLUMNS, n] L^-1 times columns 1, v, p - c, y */
  double *weights;  /**< [3, n] L^-1 times (residuals minus fitted terms) */
  double terms[SUPINE_KRIGING_TERMS]; /**< fitted terms t, b and r; 0 for known terms */
  /** Covariance of the terms; 0 for known terms. */
  double covariance[SUPINE_KRIGING_TERMS][SUPINE_KRIGING_TERMS];
  /** Covariance of the terms, summed over the axes, for the columns 1, v and p - c. At a point with
   * the values m of these columns, the terms add m' spread m to the variance, mm^2. */
  double spread[SUPINE_KRIGING_TERMS][SUPINE_KRIGING_TERMS];
  double log_likelihood; /**< restricted log likelihood of the residuals, without constants */
} supine_kriging;

/** Compute the covariance of the random field between two points on one axis, mm^2. */
double supine_kriging_covariance(const supine_kriging_model *model, const supine_kriging_point *a,
                                 const supine_kriging_point *b);

/** Factor a symmetric positive definite matrix [count, count] as L L', and write L into its lower
 * triangle. Return false if it is not positive definite. */
bool supine_kriging_factor(size_t count, double *matrix);

size_t supine_kriging_space(size_t count);

/** Fit the terms and g to the residuals of points.
 * @param count   1 to SUPINE_KRIGING_POINTS_MAX
 * @param points  [count]; keep them as long as the fit is used
 * @param space   [supine_kriging_space(count)]; keep it as long as the fit is used
 * @retval SUPINE_ERROR_ARGUMENT   a rotation is unknown and the points lie on one line
 * @retval SUPINE_ERROR_NUMERICAL  the covariance of the points is not positive definite: a number
 *                                 is not finite, or points at one position have a noise of 0 */
supine_status supine_kriging_fit(const supine_kriging_options *options, size_t count,
                                 const supine_kriging_point *points, double *space,
                                 supine_kriging *fit, supine_error *error);

/** Compute the residual of a point minus its prediction by all other points.
 * @param residual  [3] mm, written
 * @param scratch   [count] work space
 * @return expected 3-D standard deviation of this difference, mm; 0 if there is no prediction */
double supine_kriging_leave_out(const supine_kriging *fit, size_t point, double residual[3],
                                double *scratch);

/** Points of one lung at which to predict. */
typedef struct supine_kriging_target {
  size_t count, lung;
  const float *position; /**< [count, 3] positions in the scan, mm */
  const float *size;     /**< [count] lengths of the displacements, mm */
  const float *volume;   /**< [count, 3] v of each point, mm; NULL if the volume is known */
} supine_kriging_target;

/** Predict t + b v + r x (p - c) + g and its 3-D variance at every point of a target.
 * @param shift     [count, 3] mm, written
 * @param variance  [count] mm^2, written
 * Cost: n^2 / 2 + 15 n multiplications per point, for n observed points. */
void supine_kriging_predict(const supine_kriging *fit, const supine_kriging_target *target,
                            float *shift, float *variance);

#endif
