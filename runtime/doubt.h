/* SPDX-License-Identifier: MIT */
/** @file
 * The random field of supine/doubt.h: what its functions share. */
#ifndef SUPINE_DOUBT_FIELD_H
#define SUPINE_DOUBT_FIELD_H

#include <supine/doubt.h>

#include "runtime/location.h"

enum {
  /* A vertex has an error vector for each of: the assumed volume, the weight of the heart, sliding
   * along the chest wall, and a collapsed lung. */
  DOUBT_VECTORS = 4,
  DOUBT_BLOCK = 32 /* vertices whose features are evaluated at once */
};

struct supine_doubt {
  const supine_basis *basis;
  size_t state_count;
  bool another_day;
  const supine_location *location; /**< NULL unless the field is that of located lungs */
  /** Fit of a random field to what was observed: points of `location`, or a fit's landmarks. NULL
   * if nothing was. */
  const supine_kriging *seen;
  double turn[SUPINE_DOUBT_STATES_MAX][3]; /**< change of unit gravity since `from` */
  /** Row s is state s: its products are the correlations C_st. */
  double root[SUPINE_DOUBT_STATES_MAX][SUPINE_DOUBT_STATES_MAX];
  supine_expected_model model[]; /**< [state_count] */
};

/** What the covariance needs of a vertex in a state. */
typedef struct supine_doubt_features {
  size_t state, lung;
  double at[3];     /**< predicted position, mm */
  double place[3];  /**< position in the scan, mm */
  double deviation; /**< of each axis, by displacement and turn, mm: 2/3 sigma */
  /** The part of the error of which some was observed: this factor times the error of kriging at
   * the place `seen`. It is 0 where nothing was, and no part of `deviation`. */
  double seen_factor;
  supine_kriging_point seen;
  double vector[DOUBT_VECTORS][3]; /**< vectors whose products are covariances, mm */
} supine_doubt_features;

/** The features of consecutive vertices, of one lung if the field is that of located lungs.
 * Initialise `doubt`, `state` and `end`. */
typedef struct supine_doubt_walk {
  const supine_doubt *doubt;
  size_t state;
  size_t end;         /**< the vertex after the last one */
  size_t first, last; /**< vertices first <= i < last are in `features` */
  supine_doubt_features features[DOUBT_BLOCK];
} supine_doubt_walk;

/** Return the features of the vertex at which a walk has arrived. They are evaluated in blocks, and
 * last until the next call. */
const supine_doubt_features *supine_doubt_at(supine_doubt_walk *walk, size_t vertex);

/** Evaluate one vertex. */
void supine_doubt_evaluate_one(const supine_doubt *doubt, const supine_doubt_point *point,
                               supine_doubt_features *features);

/** Return the correlation of the errors of two places: k_ij of supine/doubt.h. */
double supine_doubt_kernel(const double a[3], size_t a_lung, const double b[3], size_t b_lung);

/** Return the variance of each axis, mm^2, that is the same everywhere: that of another day, if it
 * was asked for, or what the residuals of located lungs leave. */
double supine_doubt_common_square(const supine_doubt *doubt);

/** Compute the covariance of two points without that of their vectors, mm^2.
 * @param a_white, b_white  [observed points] of supine_doubt_whiten; not used if nothing was seen
 * @param covariance        [3, 3] written; a multiple of the identity but for located lungs */
void supine_doubt_covary(const supine_doubt *doubt, const supine_doubt_features *a,
                         const double *a_white, const supine_doubt_features *b,
                         const double *b_white, double covariance[9]);

/** Add the positions of the vertices of a lung, and their vectors times `factor`, to numbers [N,
 * 3], mm. */
void supine_doubt_add_positions(const supine_doubt *doubt, size_t state, size_t lung,
                                const double factor[DOUBT_VECTORS], float *xyz);

/** Compute supine_kriging_whiten of a point, if anything was observed. */
void supine_doubt_whiten(const supine_doubt *doubt, const supine_doubt_features *features,
                         double white[SUPINE_KRIGING_LANDMARKS_MAX]);

#endif
