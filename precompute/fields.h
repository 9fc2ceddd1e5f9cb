/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Fields that another simulator computed: displacements of one surface for some directions of
 * gravity, fitted by harmonics and compressed to a basis.
 *
 *     minimise over C:  sum over directions j of |u(g_j) - C Y(g_j)|^2
 *
 * The band is the one of least leave-one-out error among those that the directions determine. */
#ifndef SUPINE_FIELDS_H
#define SUPINE_FIELDS_H

#include "precompute/lungs/lungs.h"
#include "precompute/projection/accuracy.h"

/** Displacements u of every vertex for M directions. */
typedef struct supine_fields {
  size_t direction_count; /**< M */
  size_t vertex_count;    /**< N */
  double *directions;     /**< [M, 3] unit */
  double *displacement;   /**< [M, N, 3] mm */
} supine_fields;

/** Read a list (CSV with the columns gx,gy,gz,file: deformed surfaces of the same topology, named
 * relative to the list) or a safetensors file with gravity [M, 3] and displacement [M, N, 3], F32
 * or F64, in the order of the reference surface's vertices.
 *
 * @param lungs    the reference surface; deformed surfaces are joined and grouped as it was
 * @param options  axes and units of the deformed surfaces, or of a safetensors' displacements
 * @retval SUPINE_ERROR_READ    a file is missing
 * @retval SUPINE_ERROR_FORMAT  a malformed list or file, a direction that is zero or not finite, a
 *         displacement that is not finite, two equal directions (line or row named)
 * @retval SUPINE_ERROR_MESH    a surface of another topology
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_fields_load(const char *path, const supine_lungs *lungs,
                                 const supine_mesh_load_options *options, supine_fields *fields,
                                 supine_error *error);
void supine_fields_free(supine_fields *fields);

enum { SUPINE_FIT_BAND_MAX = 11 };

/** Result of a fit. */
typedef struct supine_fit_report {
  size_t band_highest;                   /**< highest band that the directions determine */
  size_t band;                           /**< chosen band */
  double condition;                      /**< condition number of its harmonics at the directions */
  size_t mode_count;                     /**< of the basis, by supine_precompute_fields */
  double error[SUPINE_FIT_BAND_MAX + 1]; /**< leave-one-out error of each band up to band_highest,
                                          * relative RMS */
  supine_accuracy accuracy; /**< of the basis, leave-one-out; mm are those of the given fields,
                             * volume 0 */
} supine_fit_report;

/** How to fit. */
typedef struct supine_fit_options {
  int band;             /**< negative: chosen */
  size_t modes;         /**< most modes; 0: the harmonics */
  const char *findings; /**< notes on the surface for the basis, one a line; optional */
  const char *made_by;  /**< for the basis's metadata; optional */
} supine_fit_options;

/** Fit, compress, cross-validate.
 *
 * @param compression  rows are vertices x components, 3 N
 * @retval SUPINE_ERROR_ARGUMENT   a band that the directions do not determine, fewer than two
 *         directions
 * @retval SUPINE_ERROR_NUMERICAL  nothing moves
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_fields_fit(const supine_fields *fields, const supine_fit_options *options,
                                supine_compression *compression, supine_fit_report *report,
                                supine_error *error);

#endif
