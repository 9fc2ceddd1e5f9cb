/* SPDX-License-Identifier: MIT */
/** @file
 * Kriging of the residuals of a displacement law at observed points.
 *
 *     y_j = t + b v_j + r x (p_j - c) + g(p_j) + noise        per point, three axes, mm
 *     cov g(p_i), g(p_j) = (s / 3) sqrt(|u_i| |u_j|) q (1 + a) exp(-a)      per axis, mm^2
 *     a = sqrt(3) |p_i - p_j| / length;  q = 1 within a lung, `across` between two lungs
 *
 * y is the observed position less the law's position, p the position in the scan and u the
 * displacement from it. The free terms are a translation t, a change b of the volume in prior
 * standard deviations, with prior variance 1, and a small rotation r about the centre c; v is the
 * displacement for b = 1. g is a random field with the sill s. All three axes share one n x n
 * covariance matrix. No function allocates; any number of threads may predict from one fit.
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
  SUPINE_KRIGING_TERMS = 7,   /**< number of terms: translation 0 to 2, volume 3, rotation 4 to 6 */
  SUPINE_KRIGING_COLUMNS = 10 /**< number of columns 1, v, p - c and y, with a row for each point */
};

typedef struct supine_kriging_model {
  double sill;   /**< s: 3-D variance of g per mm of displacement, mm */
  double length; /**< correlation length of g, mm */
  double across; /**< correlation between points of two lungs, 0 to 1 */
  double least;  /**< lower bound on |u|, mm; replaces every smaller |u| */
} supine_kriging_model;

/** Model of full breaths of 15 patients: sill 6 mm, length 90 mm, across 1/3, least 2 mm. */
extern const supine_kriging_model supine_kriging_default;

typedef struct supine_kriging_point {
  double position[3]; /**< p: position in the scan, mm */
  double volume[3];   /**< v: displacement for one prior standard deviation of the volume, mm */
  double residual[3]; /**< y: observed position less the law's position, mm */
  double size;        /**< |u|: length of the displacement, mm */
  double noise;       /**< standard deviation of the observation on each axis, mm, above 0 */
  size_t lung;
} supine_kriging_point;

/** The model, and whether the volume and a rotation are unknown; a translation always is. */
typedef struct supine_kriging_options {
  supine_kriging_model model;
  bool volume, rotation;
  double volume_mean; /**< prior mean of b, the change of volume */
} supine_kriging_options;

typedef struct supine_kriging {
  supine_kriging_model model;
  const supine_kriging_point *points; /**< [n] observed points, owned by the caller */
  size_t count;                       /**< number n of points */
  double centre[3];                   /**< c, mean position of the points, mm */
  double *factor;   /**< [n, n] lower triangle L; the covariance of the points is L L' */
  double *whitened; /**< [SUPINE_KRIGING_COLUMNS, n] L^-1 times each column */
  double *weights;  /**< [3, n] L^-1 times (the residuals less the fitted terms) */
  double terms[SUPINE_KRIGING_TERMS]; /**< fitted terms t, b and r; 0 for absent terms */
  /** Covariance of the terms; 0 for absent terms. */
  double covariance[SUPINE_KRIGING_TERMS][SUPINE_KRIGING_TERMS];
  /** Covariance of the factors of the columns 1, v and p - c, summed over the axes: where the
   * columns have the values m, the terms add the variance m' spread m, mm^2. */
  double spread[SUPINE_KRIGING_TERMS][SUPINE_KRIGING_TERMS];
  double log_likelihood; /**< restricted log likelihood of the residuals, without constant parts */
} supine_kriging;

/** Compute the covariance of g between two points on one axis, mm^2, without noise. */
double supine_kriging_covariance(const supine_kriging_model *model, const supine_kriging_point *a,
                                 const supine_kriging_point *b);

/** Factor a symmetric positive definite matrix [count, count] as L L', and write L into its lower
 * triangle. Return false if it is not positive definite. */
bool supine_kriging_factor(size_t count, double *matrix);

/** Return the number of doubles that a fit of `count` points needs. */
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

/** Compute the residual of a point less its prediction by all other points.
 * @param residual  [3] mm, written
 * @param scratch   [count] work space
 * @return expected 3-D standard deviation of this difference, mm; 0 if the other points do not
 *         determine the prediction */
double supine_kriging_leave_out(const supine_kriging *fit, size_t point, double residual[3],
                                double *scratch);

/** The points of one lung at which to predict, with the p, |u| and v of supine_kriging_point. */
typedef struct supine_kriging_target {
  size_t count, lung;
  const float *position; /**< positions p [count, 3], mm */
  const float *size;     /**< lengths |u| of displacements [count], mm */
  const float *volume;   /**< displacements v [count, 3], mm; NULL if the volume is known */
} supine_kriging_target;

/** Predict t + b v + r x (p - c) + g and its 3-D variance at every point of a target.
 * @param shift     [count, 3] mm, written
 * @param variance  [count] mm^2, written
 * Cost: n^2 / 2 + 15 n multiplications for each point, with n observed points. */
void supine_kriging_predict(const supine_kriging *fit, const supine_kriging_target *target,
                            float *shift, float *variance);

#endif
