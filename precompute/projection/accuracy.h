/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * How far a compressed field is from the full solve, on directions that no grid used; and how much
 * of the surface the field turns over. */
#ifndef SUPINE_ACCURACY_H
#define SUPINE_ACCURACY_H

#include "precompute/physics/volume_forms.h"
#include "precompute/projection/projection.h"

/** Errors of displacement over all vertices and held-out directions. */
typedef struct supine_accuracy {
  size_t direction_count;
  /** Of the field at one breath scale, relative to the RMS displacement. */
  double relative_rms, relative_p95, relative_max;
  /** Where both sides hold exactly this volume: mL, or, of lungs whose rest is known, the part of
   * the way from the reference to rest; 0: the surface is open, and the next three too. */
  double volume;
  double rms_mm, p95_mm, max_mm;
} supine_accuracy;

/** What the field is compared with: the full solve at some directions. */
typedef struct supine_truth {
  size_t direction_count;
  const double *directions; /**< [D, 3] */
  size_t rank;
  const double *columns;   /**< [N, rank], of which the full solve is a sum */
  const double *functions; /**< [D, rank] */
  const double *cubic;     /**< [D, 3] volume against breath scale, mL; NULL: open surface */
} supine_truth;

/** A volume to compare at, mL from the reference. */
typedef struct supine_accuracy_state {
  const double *resting; /**< [9] the resting volume (runtime.h): at rest in every direction */
  double volume;         /**< NULL above: the same in every direction */
} supine_accuracy_state;

/** The state's volume at harmonics `y` of bands 0 to 2 at least, mL. */
double supine_accuracy_state_volume(const supine_accuracy_state *state, const double *y);

/** Spreads `count` directions [count, 3] evenly on the sphere along a spiral of golden angles; none
 * is a node of a product grid. */
void supine_accuracy_held_out_directions(size_t count, double *directions);

/** Measures. The 95th percentiles come from a histogram whose bins are 0.4 % wide.
 * @param directions  [N, 3] d
 * @param forms       of the compression's coefficients; NULL: open surface
 * @param state       to compare at; halved until every direction reaches it
 * @retval SUPINE_ERROR_ARGUMENT  more than SUPINE_MODES_MADE_MAX modes or SUPINE_SPAN_MAX columns
 * @retval SUPINE_ERROR_MEMORY, SUPINE_ERROR_NUMERICAL (no volume is reached) */
supine_status supine_accuracy_measure(const supine_truth *truth,
                                      const supine_compression *compression,
                                      const double *directions, const supine_volume_forms *forms,
                                      const supine_accuracy_state *state, supine_accuracy *accuracy,
                                      supine_error *error);

/** Share, 0 to 1, of the triangles whose normal turns by more than a right angle on the way to a
 * state: the largest of the six postures with gravity along an axis that reach it. Looks at
 * up to 50,000 triangles, evenly taken. Where it is more than a few in a thousand, the surface
 * looks torn: neighbours move apart by more than lies between them.
 * @param directions  [N, 3] d
 * @param forms       of the compression's coefficients: the surface is closed
 * @retval SUPINE_ERROR_ARGUMENT  more than SUPINE_MODES_MADE_MAX modes
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_accuracy_turned_over(const supine_lungs *lungs, const double *directions,
                                          const supine_compression *compression,
                                          const supine_volume_forms *forms,
                                          const supine_accuracy_state *state, double *share);

#endif
