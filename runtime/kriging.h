/* SPDX-License-Identifier: MIT */
/** @file
 * Kriging of residuals. The residual y_j of point j, mm, is its observed position minus its
 * predicted position:
 *
 *     y_j = t + b v_j + r x (p_j - c) + g(p_j) + noise
 *
 *     t    translation, always fitted
 *     b    change of the volume, divided by its prior standard deviation, fitted if it is unknown
 *     v_j  displacement of point j for b = 1, mm
 *     r    rotation vector about the mean c of all p_j, rad, small, fitted on request
 *     p_j  position of point j in the scan, mm
 *     g    random field, whose coordinates on x, y and z are independent
 *     noise  error of the observed position, independent for each point and axis
 *
 * A point that was seen along a line has one more number that is fitted, and of which nothing is
 * known before: how far along the line it lies. Its residual then counts across the line only.
 *
 * Each coordinate of g has the covariance, mm^2,
 *
 *     cov(g(p_i), g(p_j)) = (sill / 3) sqrt(|u_i| |u_j|) q (1 + a) exp(-a)
 *     a = sqrt(3) |p_i - p_j| / correlation length;  q = 1 within a lung, less between two lungs
 *
 * where u_i is the displacement of point i from the scan, and sill is the variance of g per mm of
 * displacement. All axes share one n x n covariance matrix of the n points. No function allocates;
 * any number of threads may predict from one fit.
 *
 * The covariance is the Matern covariance of order 3/2 (Rasmussen & Williams, Gaussian Processes
 * for Machine Learning, 2006, equation 4.17), and the fit is universal kriging (section 2.7). */
#ifndef SUPINE_KRIGING_H
#define SUPINE_KRIGING_H

#include <math.h>
#include <stdbool.h>
#include <stddef.h>

#include <supine/status.h>

enum {
  SUPINE_KRIGING_POINTS_MAX = 300,
  SUPINE_KRIGING_LANDMARKS_MAX = 900, /**< of supine_kriging_fit_landmarks */
  SUPINE_KRIGING_TERMS = 7,           /**< fitted numbers: 3 translation, 1 volume, 3 rotation */
  SUPINE_KRIGING_COLUMNS = 10,
  SUPINE_KRIGING_LEFT_MAX = 4 /**< views of one point that are left out together */
};

typedef struct supine_kriging_model {
  double sill;   /**< variance of the random field, summed over x, y and z, divided by the
                    displacement, mm */
  double length; /**< correlation length of the random field, mm */
  double across; /**< factor of the covariance if two points are in different lungs, 0 to 1 */
  double least;  /**< shorter displacements count as displacements of this length, mm */
} supine_kriging_model;

/** The covariance of the residuals of the default law, from the landmarks of full breaths of 15
 * people, judged on held-out blocks of 40 mm of the same people. */
extern const supine_kriging_model supine_kriging_default;

typedef struct supine_kriging_point {
  double position[3]; /**< position in the scan, mm */
  double volume[3];   /**< shift if the volume grows by one prior standard deviation, mm */
  double residual[3]; /**< observed position minus predicted position, mm */
  double size;        /**< length of the displacement from the scan, mm */
  double noise;       /**< standard deviation of the observed position on each axis, mm, above 0 */
  size_t lung;
  bool on_line;        /**< whether only the residual across `direction` was observed */
  double direction[3]; /**< unit vector of the line; 0 for a point */
} supine_kriging_point;

/** Options of a fit. A translation is fitted unless `field_only`. `volume` and `rotation` tell
 * whether to fit a change of the volume of the lungs, and a rotation, too. */
typedef struct supine_kriging_options {
  supine_kriging_model model;
  bool volume, rotation;
  bool field_only;    /**< fit no term at all, not even a translation */
  double volume_mean; /**< prior mean of the change of the volume, in prior standard deviations */
  double rotation_mean[3];   /**< prior mean of the rotation vector, rad */
  double rotation_deviation; /**< prior standard deviation about each axis, rad; 0 for no prior */
  double axis[3];            /**< unit vector along which the translation has a prior */
  double axis_mean;          /**< prior mean of the translation along `axis`, mm */
  double axis_deviation;     /**< prior standard deviation along `axis`, mm; 0 for no prior */
} supine_kriging_options;

typedef struct supine_kriging {
  supine_kriging_model model;
  const supine_kriging_point *points; /**< [count] observed points, owned by the caller */
  size_t count;
  bool has_terms;   /**< whether any term is fitted */
  double centre[3]; /**< mean position of the points, mm */
  double *factor;   /**< [count, count] lower triangle L of the covariance matrix L L' */
  /** [SUPINE_KRIGING_COLUMNS, count] the matrix L^-1 X, transposed, with L in `factor`. Row j of X
   * has ten numbers of point j: 1; its displacement per prior standard deviation of the volume [3];
   * its position minus `centre` [3]; its residual [3]. */
  double *whitened;
  double *weights; /**< [3, count] L^-1 (residuals - their fit by `terms`), with L in `factor` */
  /** [count, count] Cholesky factor G of D' K^-1 D, where column j of D is the direction of the
   * line of point j, at its coordinates; for a point, a row of the identity. NULL without lines. */
  double *lines;
  /** [SUPINE_KRIGING_TERMS + 1, count] G^-1 D' K^-1 times what each term adds, then times the
   * residuals. */
  double *along;
  /** Fitted translation [3], mm, volume change, prior standard deviations, and rotation [3], rad; 0
   * where not fitted. */
  double terms[SUPINE_KRIGING_TERMS];
  /** Covariance matrix of `terms`. Rows and columns of terms that are not fitted are 0. */
  double covariance[SUPINE_KRIGING_TERMS][SUPINE_KRIGING_TERMS];
  /** Covariance of `terms` for the first seven columns of X, a matrix S. Errors of `terms` add m' S
   * m, mm^2, to the variance (sum over x, y and z) of a prediction. m is the row of X for the
   * predicted point, minus its prediction from the rows of the observed points. */
  double spread[SUPINE_KRIGING_TERMS][SUPINE_KRIGING_TERMS];
  double log_likelihood; /**< restricted log likelihood of the residuals, up to a constant */
} supine_kriging;

/** Compute the covariance of one coordinate (x, y or z) of the random field at two points p and q,
 * mm^2. exp(-a) is the 64th power of exp(-a / 64), which a polynomial of degree 8 approximates, so
 * that compilers can vectorise a loop over points. The error is below 1e-13 times the covariance at
 * distance 0.
 * @param p, q            [3] positions in the scan, mm
 * @param p_size, q_size  lengths of the displacements from the scan, mm */
static inline double supine_kriging_covariance(const supine_kriging_model *model, const double *p,
                                               double p_size, const double *q, double q_size,
                                               bool same_lung) {
  const double x = p[0] - q[0];
  const double y = p[1] - q[1];
  const double z = p[2] - q[2];
  const double sizes = (p_size > model->least ? p_size : model->least) *
                       (q_size > model->least ? q_size : model->least);
  const double far = sqrt(3.0) / model->length * sqrt(x * x + y * y + z * z);
  const double a = far < 40.0 ? far : 40.0;
  const double t = a / -64.0;
  double e = 1.0 + t / 6.0 * (1.0 + t / 7.0 * (1.0 + t / 8.0));
  e = 1.0 + t * (1.0 + t / 2.0 * (1.0 + t / 3.0 * (1.0 + t / 4.0 * (1.0 + t / 5.0 * e))));
  for (int square = 0; square < 6; ++square) {
    e *= e;
  }
  return model->sill / 3.0 * sqrt(sizes) * (same_lung ? 1.0 : model->across) * (1.0 + a) * e;
}

/** Return the standard deviation of one coordinate of the random field where the displacement from
 * the scan has the length `size`, mm. */
static inline double supine_kriging_deviation(const supine_kriging_model *model, double size) {
  return sqrt(model->sill / 3.0 * (size > model->least ? size : model->least));
}

/** Factor a symmetric positive definite matrix [count, count] as L L', and write L into its lower
 * triangle. Return false if the matrix is not positive definite. */
bool supine_kriging_factor(size_t count, double *matrix);

/** Solve L x = b for the lower triangle L [count, count] in `factor`. Replace b in `x` by the
 * solution. */
void supine_kriging_forward(size_t count, const double *factor, double *x);

/** As supine_kriging_forward, for L' x = b. */
void supine_kriging_backward(size_t count, const double *factor, double *x);

/** Return the column of supine_kriging.whitened that `term` (0 to 2: translation, 3: volume, 4 to
 * 6: rotation) multiplies in the residual along `axis`. Write the sign of the product, or 0 if the
 * term does not change this coordinate. */
int supine_kriging_column(size_t term, size_t axis, double *sign);

/** Compute `lines` and `along` of a fit.
 * @param scratch  [count] work space
 * @return whether the points' covariance is positive definite */
bool supine_kriging_add_lines(supine_kriging *fit, double *scratch);

/** Compute G^-1 D' K^-1 y for residuals y.
 * @param whitened  [3, count] L^-1 y
 * @param seen      [count] written */
void supine_kriging_see_lines(const supine_kriging *fit, const double *whitened, double *seen);

/** Subtract from `weights` [3, count], L^-1 times residuals, what fitted terms contribute, and the
 * positions along lines that then fit best.
 * @param seen  [count] of supine_kriging_see_lines, for points on lines; replaced */
void supine_kriging_subtract_terms(const supine_kriging *fit,
                                   const double terms[SUPINE_KRIGING_TERMS], double *seen,
                                   double *weights);

/** Compute G^-1 D' (weights e_a) for the unit vector e_a of each axis; G and D as in
 * supine_kriging.lines.
 * @param weights  [count] weights of the points
 * @param seen     [3, count] written */
void supine_kriging_project_lines(const supine_kriging *fit, const double *weights, double *seen);

/** Compute the variance, summed over x, y and z, that the fitted terms and the positions along the
 * lines add to a prediction, mm^2.
 * @param row  [SUPINE_KRIGING_TERMS] row of X for the predicted point, minus its prediction from
 * the rows of the observed points (vary in kriging_predict.c)
 * @param w    [count] L^-1 times the covariances with the observed points; replaced */
double supine_kriging_line_variance(const supine_kriging *fit, const double *row, double *w);

size_t supine_kriging_space(size_t count);

/** Fit translation, volume and rotation, if selected by the options, and the random field to the
 * residuals of points.
 * @param count   1 to SUPINE_KRIGING_POINTS_MAX
 * @param points  [count]; keep them as long as the fit is used
 * @param space   [supine_kriging_space(count)]; keep it as long as the fit is used */
supine_status supine_kriging_fit(const supine_kriging_options *options, size_t count,
                                 const supine_kriging_point *points, double *space,
                                 supine_kriging *fit, supine_error *error);

/** Return the number of doubles of work space that supine_kriging_leave_out needs. */
size_t supine_kriging_scratch(size_t count);

/** Predict the residual of an observed point from others.
 * @param left      number of points to leave out, 1 to SUPINE_KRIGING_LEFT_MAX
 * @param points    [left] their indices; the first one is predicted
 * @param residual  [3] residual minus its prediction, mm, written
 * @param scratch   [supine_kriging_scratch(count)] work space
 * @return expected RMS length of this difference, mm; 0 if no prediction is possible. Across the
 *   line, for a point on a line */
double supine_kriging_leave_out(const supine_kriging *fit, size_t left, const size_t *points,
                                double residual[3], double *scratch);

/** Points of one lung at which to predict. */
typedef struct supine_kriging_target {
  size_t count, lung;
  const float *position; /**< [count, 3] positions in the scan, mm */
  const float *size;     /**< [count] lengths of the displacements from the scan, mm */
  const float *volume; /**< [count, 3] shift per prior standard deviation of volume, mm; or NULL */
} supine_kriging_target;

/** Predict the residual (true minus predicted position) at every point of a target. Cost: n^2 / 2 +
 * 15 n multiplications per point, for n observed points.
 * @param shift     [count, 3] predicted residuals, mm, written
 * @param variance  [count] expected squared error of each prediction, mm^2, written */
void supine_kriging_predict(const supine_kriging *fit, const supine_kriging_target *target,
                            float *shift, float *variance);

/** Compute L^-1 k for a place: k are the covariances of one coordinate of the field there with
 * those at the observed points, L is supine_kriging.factor.
 * @param at     its position, size, volume and lung count
 * @param white  [count] written */
void supine_kriging_whiten(const supine_kriging *fit, const supine_kriging_point *at,
                           double *white);

/** Compute the covariance of the errors of the predictions at two places, mm^2.
 * @param a_white, b_white  [count] of supine_kriging_whiten
 * @param covariance        [3, 3] by rows, written */
void supine_kriging_covary(const supine_kriging *fit, const supine_kriging_point *a,
                           const double *a_white, const supine_kriging_point *b,
                           const double *b_white, double covariance[9]);

/** Compute by how much terms move a place: t + b v + r x (p - c) of the top of this file. */
void supine_kriging_move(const supine_kriging *fit, const double terms[SUPINE_KRIGING_TERMS],
                         const supine_kriging_point *at, double moved[3]);

/** Predict from other residuals of the same points, whose terms have the prior mean 0.
 * @param residuals  [3, count] mm; replaced by the weights of supine_kriging_shift
 * @param terms      fitted terms, written */
void supine_kriging_refit(const supine_kriging *fit, double *residuals,
                          double terms[SUPINE_KRIGING_TERMS]);

/** Compute what the weights and terms of supine_kriging_refit predict at a place, mm. */
void supine_kriging_shift(const supine_kriging *fit, const double *weights,
                          const double terms[SUPINE_KRIGING_TERMS], const supine_kriging_point *at,
                          double shift[3]);

/** Return a landmark of a patient's fit as an observed point of supine_kriging_fit_landmarks, or
 * another place of that field. */
supine_kriging_point supine_kriging_landmark(const double position[3], size_t lung);

/** Fit the random field of the errors after a patient's fit, which has the variance 1 everywhere
 * before its landmarks are known, the correlation of supine_kriging_default, and noise of a tenth
 * of its variance. No term is fitted.
 * @param landmarks  [count] of supine_kriging_landmark; keep them as long as the fit is used
 * @param space      [supine_kriging_space(count)]; keep it as long as the fit is used */
supine_status supine_kriging_fit_landmarks(size_t count, const supine_kriging_point *landmarks,
                                           double *space, supine_kriging *fit, supine_error *error);

/** Return the share of the field's variance that landmarks leave at a place, by simple kriging:
 * 1 - k' K^-1 k, 0 to 1 (Rasmussen & Williams 2006, equation 2.26).
 * @param scratch  [count] work space */
double supine_kriging_share(const supine_kriging *fit, const supine_kriging_point *at,
                            double *scratch);

#endif
