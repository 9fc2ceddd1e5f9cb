/* SPDX-License-Identifier: MIT */
/** @file
 * Kriging of the residuals of a displacement law at observed points.
 *
 *     y_j = t + b v_j + r x (p_j - c) + g(p_j) + noise        per point, three axes, mm
 *     cov g(p_i), g(p_j) = (s / 3) sqrt(|u_i| |u_j|) q (1 + a) exp(-a)      per axis, mm^2
 *     a = sqrt(3) |p_i - p_j| / length;  q = 1 within a lung, `across` between two
 *
 * y is the observed position less the law's, t a free translation, b an unknown change of volume in
 * prior standard deviations (its prior has variance 1), and r a free small rotation about the
 * centre c. All three axes share one n x n covariance matrix. No function allocates; any number of
 * threads may predict from one fit.
 *
 * The covariance is Matern's of order 3/2 (Rasmussen & Williams, Gaussian Processes for Machine
 * Learning, 2006, equation 4.17); free terms are those of universal kriging (section 2.7). */
#ifndef SUPINE_KRIGING_H
#define SUPINE_KRIGING_H

#include <stdbool.h>
#include <stddef.h>

#include <supine/status.h>

enum {
  SUPINE_KRIGING_POINTS_MAX = 300,
  SUPINE_KRIGING_TERMS = 7,   /**< unknowns: translation 0 to 2, volume 3, rotation 4 to 6 */
  SUPINE_KRIGING_COLUMNS = 10 /**< number of columns, a row for each point: 1, v, p - c, y */
};

typedef struct supine_kriging_model {
  double sill;   /**< s, mm: 3-D variance of g for each mm of displacement */
  double length; /**< correlation length of g, mm */
  double across; /**< correlation of two lungs, 0 to 1 */
  double least;  /**< lower bound on |u|, mm: a smaller |u| is replaced by it */
} supine_kriging_model;

/** The constants fitted to full breaths of 15 patients: 6 mm, 90 mm, 1/3, 2 mm. */
extern const supine_kriging_model supine_kriging_default;

typedef struct supine_kriging_point {
  double position[3]; /**< p, in the scan, mm */
  double volume[3];   /**< v: displacement by one prior standard deviation of the volume, mm */
  double residual[3]; /**< y: observed position less the law's, mm */
  double size;        /**< |u|, mm */
  double noise;       /**< standard deviation per axis, mm, above 0 */
  size_t lung;
} supine_kriging_point;

/** The model, and which terms are unknown besides the translation. */
typedef struct supine_kriging_options {
  supine_kriging_model model;
  bool volume, rotation;
  double volume_mean; /**< prior mean of b */
} supine_kriging_options;

typedef struct supine_kriging {
  supine_kriging_model model;
  const supine_kriging_point *points; /**< [n] owned by the caller */
  size_t count;                       /**< n */
  double centre[3];                   /**< c, mean position of the points, mm */
  double *factor;   /**< [n, n] lower triangle L; the covariance of the points is L L' */
  double *whitened; /**< [COLUMNS, n] L^-1 times each column */
  double *weights;  /**< [3, n] L^-1 times the residuals y less the fitted terms */
  double terms[SUPINE_KRIGING_TERMS]; /**< fitted t, b and r; 0 for terms that are not unknown */
  /** Covariance of the terms; 0 for terms that are not unknown. */
  double covariance[SUPINE_KRIGING_TERMS][SUPINE_KRIGING_TERMS];
  /** Covariance of the fitted terms, by the columns 1, v and p - c that they multiply, summed over
   * the three axes: m' spread m is the variance that the terms add where the columns are m. */
  double spread[SUPINE_KRIGING_TERMS][SUPINE_KRIGING_TERMS];
  double log_likelihood; /**< restricted log likelihood, without constant terms */
} supine_kriging;

/** Compute cov g(p_i), g(p_j) of one axis, mm^2, without noise. */
double supine_kriging_covariance(const supine_kriging_model *model, const supine_kriging_point *a,
                                 const supine_kriging_point *b);

/** Factor a symmetric positive definite matrix as L L', and write L over its lower triangle.
 * @return false if it is not positive definite */
bool supine_kriging_factor(size_t count, double *matrix);

/** Return the number of doubles that a fit of `count` points needs. */
size_t supine_kriging_space(size_t count);

/** Fit the terms and g to residuals.
 * @param count   1 to SUPINE_KRIGING_POINTS_MAX
 * @param points  [count]; keep them as long as the fit is used
 * @param space   [supine_kriging_space(count)]; keep it as long as the fit is used
 * @retval SUPINE_ERROR_ARGUMENT   a rotation is asked for and the points are on one line
 * @retval SUPINE_ERROR_NUMERICAL  the covariance is not positive definite: numbers not finite, or a
 *                                 noise of 0 at repeated points */
supine_status supine_kriging_fit(const supine_kriging_options *options, size_t count,
                                 const supine_kriging_point *points, double *space,
                                 supine_kriging *fit, supine_error *error);

/** Compute the residual of a point less its prediction by all other points.
 * @param residual  [3] mm, written
 * @param scratch   [count] work space
 * @return expected 3-D standard deviation of the result, mm; 0 if the other points do not determine
 *         it */
double supine_kriging_leave_out(const supine_kriging *fit, size_t point, double residual[3],
                                double *scratch);

/** The points of one lung at which to predict, as in supine_kriging_point. */
typedef struct supine_kriging_target {
  size_t count, lung;
  const float *position; /**< [count, 3] p, mm */
  const float *size;     /**< [count] |u|, mm */
  const float *volume;   /**< [count, 3] v, mm; NULL if the volume is known */
} supine_kriging_target;

/** Predict t + b v + r x (p - c) + g and its 3-D variance.
 * @param shift     [count, 3] mm, written
 * @param variance  [count] mm^2, written
 * Cost: n^2 / 2 + 15 n multiplications a point. */
void supine_kriging_predict(const supine_kriging *fit, const supine_kriging_target *target,
                            float *shift, float *variance);

#endif
