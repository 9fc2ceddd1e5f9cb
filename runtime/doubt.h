/* SPDX-License-Identifier: MIT */
/** @file
 * The random field of supine/doubt.h: what its functions share. */
#ifndef SUPINE_DOUBT_FIELD_H
#define SUPINE_DOUBT_FIELD_H

#include <supine/doubt.h>

#include "runtime/expected.h"

enum { DOUBT_VECTORS = 4 }; /* assumed volume, heart, sliding, collapse */

struct supine_doubt {
  const supine_basis *basis;
  size_t state_count;
  bool another_day;
  double turn[SUPINE_DOUBT_STATES_MAX][3]; /**< change of unit gravity since `from` */
  /** Row s is state s: its products are the correlations C_st. */
  double root[SUPINE_DOUBT_STATES_MAX][SUPINE_DOUBT_STATES_MAX];
  supine_expected_model model[]; /**< [state_count] */
};

/** What the covariance needs of a vertex in a state. */
typedef struct supine_doubt_features {
  size_t state, lung;
  double at[3];                    /**< predicted position, mm */
  double place[3];                 /**< position in the scan, mm */
  double deviation;                /**< of each axis, by displacement and turn, mm: 2/3 sigma */
  double vector[DOUBT_VECTORS][3]; /**< vectors whose products are covariances, mm */
} supine_doubt_features;

/** Evaluate vertices begin <= i < end of one lung, at most LOCATE_BLOCK. */
void supine_doubt_evaluate(const supine_doubt *doubt, size_t state, size_t begin, size_t end,
                           supine_doubt_features *features);

/** Evaluate one vertex. */
void supine_doubt_evaluate_one(const supine_doubt *doubt, const supine_doubt_point *point,
                               supine_doubt_features *features);

/** Return k_ij of supine/doubt.h, the correlation of the errors of two points. */
double supine_doubt_kernel(const supine_doubt_features *a, const supine_doubt_features *b);

/** Return the variance of each axis by another day, mm^2; 0 unless it was asked for. */
double supine_doubt_day_square(const supine_doubt *doubt);

/** Return the covariance of one axis of the isotropic terms of two points, mm^2. */
double supine_doubt_isotropic(const supine_doubt *doubt, const supine_doubt_features *a,
                              const supine_doubt_features *b);

#endif
