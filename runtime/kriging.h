/* SPDX-License-Identifier: MIT */
/** @file
 * Kriging of the residuals of a displacement law at observed points.
 *
 * The residual y_j of point j, mm, is the observed position minus the position that this
 * law predicts. The model of the residual is
 *
 *     y_j = t + b v_j + r x (p_j - c) + g(p_j) + noise
 *
 * with three unknown terms: a translation t, a change b of the volume, and a small rotation r about
 * the centre c. The unit of b is the prior standard deviation of the volume, v_j is the
 * displacement of point j for b = 1, and p_j is the position of point j in the scan. g is a random
 * field. On each axis, the covariance of g, mm^2, is
 *
 *     cov(g(p_i), g(p_j)) = (s / 3) sqrt(|u_i| |u_j|) q (1 + a) exp(-a)
 *     a = sqrt(3) |p_i - p_j| / length;  q = 1 within a lung, `across` between two lungs
 *
 * u_i is the displacement of point i from the scan, and s is the sill. All three axes share one
 * n x n covariance matrix of the n points. No function allocates; any number of threads may predict
 * from one fit.
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
  SUPINE_KRIGING_TERMS = 7,   /**< number of terms: 3 translation, 1 volume, 3 rotation */
  SUPINE_KRIGING_COLUMNS = 10 /**< number of columns of supine_kriging.whitened */
};

typedef struct supine_kriging_model {
  double sill;   /**< 3-D variance of the random field, mm^2, for each mm of displacement */
  double length; /**< correlation length of the random field, mm */
  double across; /**< factor of the covariance between points of two lungs, 0 to 1 */
  double least;  /**< shorter displacements count as displacements of this length, mm */
} supine_kriging_model;

/** Model estimated from full breaths of 15 patients. */
extern const supine_kriging_model supine_kriging_default;

typedef struct supine_kriging_point {
  double position[3]; /**< position in the scan, mm */
  double volume[3];   /**< displacement if the volume grows by one prior standard deviation, mm */
  double residual[3]; /**< observed position minus predicted position, mm */
  double size;        /**< length of the displacement from the scan, mm */
  double noise;       /**< standard deviation of the observed position on each axis, mm, above 0 */
  size_t lung;
} supine_kriging_point;

/** Options of a fit. `volume` and `rotation` select terms to fit in addition to the translation. */
typedef struct supine_kriging_options {
  supine_kriging_model model;
  bool volume, rotation;
  double volume_mean; /**< prior mean of the change of the volume, in prior standard deviations */
} supine_kriging_options;

typedef struct supine_kriging {
  supine_kriging_model model;
  const supine_kriging_point *points; /**< [count] owned by the caller */
  size_t count;
  double centre[3]; /**< mean position of the points, mm */
  double *factor;   /**< [count, count] lower triangle L of the covariance matrix L L' */
  /** [SUPINE_KRIGING_COLUMNS, count] the inverse of `factor` times ten columns with one number for
   * each point: 1, supine_kriging_point.volume [3], position - `centre` [3], residual [3]. */
  double *whitened;
  double *weights; /**< [3, count] the inverse of `factor` times (residuals - fitted terms) */
  double terms[SUPINE_KRIGING_TERMS]; /**< translation, volume and rotation; 0 if not fitted */
  /** Covariance matrix of `terms`. Rows and columns of terms that are not fitted are 0. */
  double covariance[SUPINE_KRIGING_TERMS][SUPINE_KRIGING_TERMS];
  /** Matrix S for which errors of the fitted terms add the variance m' S m, mm^2, to a prediction.
   * m is 1, the point's supine_kriging_point.volume [3], and position - `centre` [3]. */
  double spread[SUPINE_KRIGING_TERMS][SUPINE_KRIGING_TERMS];
  double log_likelihood; /**< restricted log likelihood of the residuals, up to a constant */
} supine_kriging;

/** Compute the covariance of the random field between two points on one axis, mm^2. */
double supine_kriging_covariance(const supine_kriging_model *model, const supine_kriging_point *a,
                                 const supine_kriging_point *b);

/** Factor a symmetric positive definite matrix [count, count] as L L', and write L into its lower
 * triangle. Return false if the matrix is not positive definite. */
bool supine_kriging_factor(size_t count, double *matrix);

size_t supine_kriging_space(size_t count);

/** Fit the terms and the random field to the residuals of points.
 * @param count   1 to SUPINE_KRIGING_POINTS_MAX
 * @param points  [count]; keep them as long as the fit is used
 * @param space   [supine_kriging_space(count)]; keep it as long as the fit is used
 * @retval SUPINE_ERROR_ARGUMENT   a rotation is to be fitted, but the points lie on one line
 * @retval SUPINE_ERROR_NUMERICAL  the covariance of the points is not positive definite: a number
 *                                 is not finite, or points at one position have a noise of 0 */
supine_status supine_kriging_fit(const supine_kriging_options *options, size_t count,
                                 const supine_kriging_point *points, double *space,
                                 supine_kriging *fit, supine_error *error);

/** Predict the residual of an observed point from all other points. Write residual - prediction.
 * @param residual  [3] mm, written
 * @param scratch   [count] work space
 * @return expected 3-D standard deviation of `residual`, mm; 0 if no prediction is possible */
double supine_kriging_leave_out(const supine_kriging *fit, size_t point, double residual[3],
                                double *scratch);

/** Points of one lung at which to predict. */
typedef struct supine_kriging_target {
  size_t count, lung;
  const float *position; /**< [count, 3] positions in the scan, mm */
  const float *size;     /**< [count] lengths of the displacements, mm */
  const float *volume;   /**< [count, 3] supine_kriging_point.volume; NULL if no volume is fitted */
} supine_kriging_target;

/** Predict the residual at every point of a target, and compute the 3-D variance of the prediction.
 * @param shift     [count, 3] predicted residuals, mm, written
 * @param variance  [count] mm^2, written
 * Cost: n^2 / 2 + 15 n multiplications per point, for n observed points. */
void supine_kriging_predict(const supine_kriging *fit, const supine_kriging_target *target,
                            float *shift, float *variance);

#endif
