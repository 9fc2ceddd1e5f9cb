/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * The error of a compressed field against the full solve, on directions that no grid used, and the
 * share of triangles that the field turns over. */
#ifndef SUPINE_ACCURACY_H
#define SUPINE_ACCURACY_H

#include "precompute/physics/model.h"
#include "precompute/physics/volume_forms.h"
#include "precompute/projection/projection.h"

/** Errors of displacement over all vertices and held-out directions. */
typedef struct supine_accuracy {
  size_t direction_count;
  double relative_rms, relative_p95, relative_max; /**< at equal gains, of the RMS displacement */
  /** The volume at which the errors in mm are stated: mL, or of lungs whose rest is known, the part
   * of the way from the reference to rest; 0: the surface is open, and there are no such errors. */
  double volume;
  double rms_mm, p95_mm, max_mm; /**< at equal volumes */
} supine_accuracy;

/** The full solve at directions that no grid used: columns x functions^T, as exact as the
 * projection's span. */
typedef struct supine_truth {
  size_t direction_count;
  double *directions; /**< [D, 3] unit */
  size_t rank;
  const double *columns; /**< [N, rank] the projection's */
  double *functions;     /**< [D, rank] */
  double *cubic;         /**< [D, 3] volume as a polynomial of the gain, mL; NULL: open surface */
} supine_truth;

/** Find the full solve at `count` held-out directions.
 * @param directions  [N, 3] d
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_accuracy_truth_create(const supine_lungs *lungs, const supine_model *model,
                                           const double *directions,
                                           const supine_projection *projection, size_t count,
                                           supine_truth *truth, supine_error *error);
void supine_accuracy_truth_free(supine_truth *truth);

/** A volume to compare at, mL beyond the reference. */
typedef struct supine_accuracy_state {
  const double
      *resting; /**< [9] harmonics of the resting volume; NULL: `volume` in every posture */
  double volume;
} supine_accuracy_state;

/** Compute the state's volume with gravity along the unit vector g, mL. */
double supine_accuracy_state_volume(const supine_accuracy_state *state, const double g[3]);

/** Spread `count` directions [count, 3] evenly on the sphere along a golden-angle spiral; none is a
 * node of a product grid. */
void supine_accuracy_held_out_directions(size_t count, double *directions);

/** Measure the error. The 95th percentiles come from a histogram whose bins are 0.4 % wide.
 * @param directions  [N, 3] d
 * @param forms       of the compression's coefficients; NULL: open surface
 * @param state       to compare at; halved until every direction reaches it
 * @retval SUPINE_ERROR_MEMORY, SUPINE_ERROR_NUMERICAL (no volume is reached) */
supine_status supine_accuracy_measure(const supine_truth *truth,
                                      const supine_compression *compression,
                                      const double *directions, const supine_volume_forms *forms,
                                      const supine_accuracy_state *state, supine_accuracy *accuracy,
                                      supine_error *error);

/** Find the share, 0 to 1, of the triangles whose normal turns by more than a right angle on the
 * way to a state: the largest of the six postures with gravity along an axis that reach it, over up
 * to 50,000 evenly chosen triangles. Above a few in a thousand the surface looks torn.
 * @param directions  [N, 3] d
 * @param forms       of the compression's coefficients: the surface is closed
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_accuracy_turned_over(const supine_lungs *lungs, const double *directions,
                                          const supine_compression *compression,
                                          const supine_volume_forms *forms,
                                          const supine_accuracy_state *state, double *share);

#endif
