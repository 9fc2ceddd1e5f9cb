/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Measure the error of a compressed field against the full physics for held-out directions of
 * gravity, and the share of triangles that the field turns over. */
#ifndef SUPINE_ACCURACY_H
#define SUPINE_ACCURACY_H

#include <supine/sh.h>

#include "precompute/physics/model.h"
#include "precompute/physics/volume_forms.h"
#include "precompute/projection/projection.h"

/** Errors of displacement over all vertices and held-out directions. */
typedef struct supine_accuracy {
  size_t direction_count;
  /** Errors of states with equal gains, as fractions of the RMS displacement. */
  double relative_rms, relative_p95, relative_max;
  /** Errors of states with equal volumes, or of the given fields of another simulator, mm. */
  double rms_mm, p95_mm, max_mm;
  /** Fraction of the requested volume at which the errors in mm were measured. If rest is unknown,
   * supine_precompute replaces it by the volume in mL. 0 for fields of another simulator. */
  double volume;
} supine_accuracy;

/** Solutions of the full physics for D held-out directions of gravity. At vertex i, the field for
 * direction d is sum over k of columns[i, k] functions[d, k], up to the tolerance of span.c. */
typedef struct supine_truth {
  size_t direction_count;
  double *directions; /**< [D, 3] unit vectors along gravity */
  size_t rank;
  const double *columns; /**< [N, rank] owned by the projection */
  double *functions;     /**< [D, rank] weights of the columns */
  double *cubic; /**< [D, 3] gained volume, mL: coefficients of the gain, its square and its cube */
} supine_truth;

/** Solve the full physics for `count` held-out directions of gravity. `truth` refers to
 * `projection`, which must outlive it.
 * @param directions  [N, 3] displacement of each vertex for a force of 1, mm
 * @param truth       release with supine_accuracy_truth_free
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_accuracy_truth_create(const supine_lungs *lungs, const supine_model *model,
                                           const double *directions,
                                           const supine_projection *projection, size_t count,
                                           supine_truth *truth, supine_error *error);
void supine_accuracy_truth_free(supine_truth *truth);

/** Spread directions [count, 3] evenly along a golden-angle spiral that avoids the grid's nodes. */
void supine_accuracy_held_out_directions(size_t count, double *directions);

/** Measure the error of a compressed field. The 95th percentiles come from a histogram whose bins
 * are at most 0.4 % wide.
 * @param directions  [N, 3] directions of displacement, mm
 * @param forms       volume forms of the compression
 * @param volume      [9] harmonics of the volume minus that of the reference surface, mL, at which
 *   errors in mm are measured; halved until the field reaches it in every direction
 * @retval SUPINE_ERROR_NUMERICAL  not even a thousandth of the volume is reached
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_accuracy_measure(const supine_truth *truth,
                                      const supine_compression *compression,
                                      const double *directions, const supine_volume_forms *forms,
                                      const double volume[9], supine_accuracy *accuracy,
                                      supine_error *error);

/** Find the share, 0 to 1, of triangles whose normals on the reference surface and on the surface
 * at a given volume differ by more than a right angle. It is the largest share in the six postures
 * with gravity along an axis. Postures in which the field cannot reach the volume are left out. Up
 * to 50,000 evenly chosen triangles are examined. Above a few in a thousand, the surface looks
 * torn.
 * @param directions  [N, 3] directions of displacement, mm
 * @param forms       volume forms of the compression
 * @param volume      [9] harmonics of the volume minus that of the reference surface, mL
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_accuracy_turned_over(const supine_lungs *lungs, const double *directions,
                                          const supine_compression *compression,
                                          const supine_volume_forms *forms, const double volume[9],
                                          double *share);

/** Relative RMS errors for the held-out directions, over at most 4096 evenly chosen vertices. */
typedef struct supine_error_table {
  size_t band_count; /**< number of bands: highest degree of the harmonics + 1 */
  double harmonics[SUPINE_SH_BAND_MAX + 1]; /**< [l] error with the first (l + 1)^2 harmonics */
  size_t mode_count;                        /**< number K of modes */
  double modes[SUPINE_MODES_MADE_MAX];      /**< [k] error with the first k + 1 modes */
} supine_error_table;

/** Tabulate the error by the number of harmonics and by the number of modes.
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_accuracy_error_table_create(const supine_truth *truth,
                                                 const supine_projection *projection,
                                                 const supine_compression *compression,
                                                 const double *directions,
                                                 supine_error_table *table);

#endif
