/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Measure the error of a compressed displacement field against exact solutions for held-out
 * directions of gravity, and the share of triangles that the field turns over. */
#ifndef SUPINE_ACCURACY_H
#define SUPINE_ACCURACY_H

#include <supine/runtime.h>
#include <supine/sh.h>

#include "base/arena.h"
#include "precompute/physics/model.h"
#include "precompute/physics/volume_forms.h"
#include "precompute/projection/projection.h"

/** Errors of the displacement over all vertices and held-out directions of gravity. */
typedef struct supine_accuracy {
  size_t direction_count;
  /** Errors of the compressed displacement before it is scaled to a lung volume, as fractions of
   * the RMS displacement. */
  double relative_rms, relative_p95, relative_max;
  /** Errors, mm, after the exact and the compressed displacement are scaled to the same volume of
   * the lungs. For another simulator's fields, these are leave-one-out errors without scaling. */
  double rms_mm, p95_mm, max_mm;
  /** Change of volume at which the errors in mm were measured, as a fraction of the change
   * requested from supine_projection_accuracy_measure. If the resting volume (FRC) is unknown,
   * supine_precompute stores the change in mL instead. 0 for another simulator's fields. */
  double volume;
  /** relative_rms as a fraction of the RMS of the part of the displacement that depends on gravity,
   * instead of the whole; 0 if there is no such part. */
  double turning_rms;
} supine_accuracy;

/** Solutions of the physical model for held-out directions of gravity. With direction d, the force
 * on vertex i, or the coordinate i of the displacements, is sum over r of columns[i, r]
 * functions[d, r], up to the tolerance of span.c. */
typedef struct supine_truth {
  supine_arena memory; /**< of the arrays that are not owned by the field */
  size_t direction_count;
  double *directions; /**< [direction_count, 3] unit vectors along gravity */
  size_t rank;
  const double *columns; /**< [rows, rank] solutions whose weighted sum is any other solution;
                            owned by the field */
  double *functions;     /**< [direction_count, rank] weights of `columns` for each direction */
  /** [direction_count, 3] coefficients of s, s^2 and s^3 in the change of the lungs' volume, mL,
   * when the displacement is multiplied by s. */
  double *cubic;
} supine_truth;

/** Solve the physical model for `count` held-out directions of gravity. `truth` refers to `field`,
 * which must outlive it.
 * @param span   directions of gravity of the columns of `field`
 * @param truth  release with supine_projection_truth_free, also after an error */
supine_status supine_projection_truth_create(const supine_lungs *lungs, const supine_model *model,
                                             const supine_span *span,
                                             const supine_gravity_field *field, size_t count,
                                             supine_truth *truth, supine_error *error);
void supine_projection_truth_free(supine_truth *truth);

/** Compute `count` unit vectors along a golden-angle spiral that avoids the nodes of the grid from
 * which harmonics are computed, into directions [count, 3]. */
void supine_projection_held_out_directions(size_t count, double *directions);

/** Measure the error of the displacement computed from the modes of `compression`, against the
 * exact solutions `truth`. Percentiles come from a histogram whose bins are at most 0.4 % wide.
 * @param rows    kind of the rows of `compression`
 * @param forms   volumes as polynomials of the weights of the modes (volume_forms.h)
 * @param volume  [9] change of volume from the reference surface, mL, at which errors in mm are
 *   measured: coefficients of spherical harmonics of the direction of gravity. It is halved until
 *   the lungs can reach it in every held-out direction; SUPINE_ERROR_NUMERICAL below a thousandth
 */
supine_status supine_projection_accuracy_measure(const supine_truth *truth,
                                                 const supine_compression *compression,
                                                 const supine_rows *rows,
                                                 const supine_volume_forms *forms,
                                                 const double volume[9], supine_accuracy *accuracy,
                                                 supine_error *error);

/** Add to `accuracy` the error of storage, which is independent of the other errors: add squares of
 * the RMS error and of the percentile, and add the maximum. The error of storage is the difference
 * between the positions that the run time computes and the same sum of modes in double precision,
 * in 16 directions of gravity, at the default volume if the surface can have it.
 * @param basis     opened with the default storage
 * @param rows      kind of the rows of `compression`
 * @param vertices  [vertices] RMS error of each vertex, mm, to which that of storage is added, or
 *   NULL */
supine_status supine_projection_accuracy_add_storage(const supine_basis *basis,
                                                     const supine_compression *compression,
                                                     const supine_rows *rows,
                                                     supine_accuracy *accuracy, float *vertices);

/** Find the share of triangles, 0 to 1, whose normals turn by more than 90 degrees from the
 * reference surface to a given volume. It is the largest share in the six postures with gravity
 * along an axis. Postures in which the lungs cannot reach the volume are left out. Up to 50,000
 * evenly chosen triangles are examined. Above a few in a thousand, the surface looks torn. The
 * arguments are those of supine_projection_accuracy_measure. */
supine_status supine_projection_turned_over(const supine_lungs *lungs, const supine_rows *rows,
                                            const supine_compression *compression,
                                            const supine_volume_forms *forms,
                                            const double volume[9], double *share,
                                            supine_error *error);

/** Compute the share of each band (degree) of the harmonics in the squared displacement of a basis.
 * @param share  [band + 1], unchanged if the surface has no area */
supine_status supine_projection_band_shares(const supine_basis *basis, double *share,
                                            supine_error *error);

/** Relative RMS errors for the held-out directions of gravity, over at most 4096 evenly chosen
 * vertices. */
typedef struct supine_error_table {
  size_t band_count; /**< number of bands: highest degree of the harmonics + 1 */
  double harmonics[SUPINE_SH_BAND_MAX + 1]; /**< [l] relative error with harmonics to degree l */
  size_t mode_count;
  double modes[SUPINE_MODES_MADE_MAX]; /**< [k] relative RMS error with the first k + 1 modes */
} supine_error_table;

/** Tabulate the error of the displacement by number of harmonics and by number of modes. */
supine_status supine_projection_error_table_create(const supine_truth *truth,
                                                   const supine_gravity_field *field,
                                                   const supine_compression *compression,
                                                   supine_error_table *table, supine_error *error);

#endif
