/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Measure the error of a compressed displacement field against exact solutions for held-out
 * directions of gravity, and the share of triangles that the field turns over. */
#ifndef SUPINE_ACCURACY_H
#define SUPINE_ACCURACY_H

#include <supine/sh.h>

#include "precompute/physics/model.h"
#include "precompute/physics/volume_forms.h"
#include "precompute/projection/projection.h"

/** Errors of the displacement over all vertices and held-out directions of gravity. */
typedef struct supine_accuracy {
  size_t direction_count;
  /** Errors if the exact and the compressed field have the same gain (factor on the displacement),
   * as fractions of the RMS displacement. */
  double relative_rms, relative_p95, relative_max;
  /** Errors if the exact and the compressed field give the lungs the same volume, mm. For another
   * simulator's fields, leave-one-out errors. */
  double rms_mm, p95_mm, max_mm;
  /** Fraction of the volume requested from supine_accuracy_measure at which the errors in mm were
   * measured. If the resting volume (FRC) is unknown, supine_precompute replaces the fraction by
   * the volume in mL. 0 for another simulator's fields. */
  double volume;
} supine_accuracy;

/** Solutions of the physical model for held-out directions of gravity. At vertex i, the field for
 * direction d is sum over k of columns[i, k] functions[d, k], up to the tolerance of span.c. */
typedef struct supine_truth {
  size_t direction_count;
  double *directions; /**< [direction_count, 3] unit vectors along gravity */
  size_t rank;
  const double *columns; /**< [N, rank] fields that are summed; owned by the projection */
  double *functions;     /**< [direction_count, rank] weights of the columns in each solution */
  /** [direction_count, 3] coefficients of s, s^2 and s^3 in the change of volume, mL, at gain s
   * (factor on the displacement). */
  double *cubic;
} supine_truth;

/** Solve the physical model for `count` held-out directions of gravity. `truth` refers to
 * `projection`, which must outlive it.
 * @param directions  [N, 3] displacement of each vertex per unit force, mm
 * @param truth       release with supine_accuracy_truth_free
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_accuracy_truth_create(const supine_lungs *lungs, const supine_model *model,
                                           const double *directions,
                                           const supine_projection *projection, size_t count,
                                           supine_truth *truth, supine_error *error);
void supine_accuracy_truth_free(supine_truth *truth);

/** Measure the error of a compressed field against the solutions `truth`. The 95th percentiles come
 * from a histogram whose bins are at most 0.4 % wide.
 * @param directions  [N, 3] displacement of each vertex per unit force, mm
 * @param forms       volumes as polynomials of the weights of the modes (volume_forms.h)
 * @param volume      [9] volume at which errors in mm are measured minus that of the reference
 *   surface, mL: coefficients of spherical harmonics of the direction of gravity; halved until the
 *   lungs can reach it in every held-out direction
 * @retval SUPINE_ERROR_NUMERICAL  the lungs cannot reach a thousandth of the volume
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_accuracy_measure(const supine_truth *truth,
                                      const supine_compression *compression,
                                      const double *directions, const supine_volume_forms *forms,
                                      const double volume[9], supine_accuracy *accuracy,
                                      supine_error *error);

/** Find the share of triangles, 0 to 1, whose normals turn by more than 90 degrees from the
 * reference surface to a given volume. It is the largest share in the six postures with gravity
 * along an axis. Postures in which the lungs cannot reach the volume are left out. Up to 50,000
 * evenly chosen triangles are examined. Above a few in a thousand, the surface looks torn.
 * @param directions  [N, 3] displacement of each vertex per unit force, mm
 * @param forms       volumes as polynomials of the weights of the modes (volume_forms.h)
 * @param volume      [9] as in supine_accuracy_measure
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_accuracy_turned_over(const supine_lungs *lungs, const double *directions,
                                          const supine_compression *compression,
                                          const supine_volume_forms *forms, const double volume[9],
                                          double *share);

/** Relative RMS errors for the held-out directions of gravity, over at most 4096 evenly chosen
 * vertices. */
typedef struct supine_error_table {
  size_t band_count; /**< number of bands: highest degree of the harmonics + 1 */
  double harmonics[SUPINE_SH_BAND_MAX + 1]; /**< [l] error with harmonics to degree l */
  size_t mode_count;
  double modes[SUPINE_MODES_MADE_MAX]; /**< [k] error with the first k + 1 modes */
} supine_error_table;

/** Tabulate the error by the number of harmonics and by the number of modes.
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_accuracy_error_table_create(const supine_truth *truth,
                                                 const supine_projection *projection,
                                                 const supine_compression *compression,
                                                 const double *directions,
                                                 supine_error_table *table);

#endif
