/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Make a basis from another simulator's fields: displacements of one surface for some directions of
 * gravity are fitted by harmonics and compressed.
 *
 *     minimise over C:  sum over directions j of |u(g_j) - C Y(g_j)|^2
 *
 * By default, of the bands that the directions determine, a higher one is chosen if it reduces the
 * leave-one-out error by more than 1 %. */
#ifndef SUPINE_FIELDS_H
#define SUPINE_FIELDS_H

#include "precompute/lungs/lungs.h"
#include "precompute/projection/accuracy.h"

/** Displacements u of every vertex for M directions of gravity. */
typedef struct supine_fields {
  size_t direction_count; /**< M */
  size_t vertex_count;    /**< N */
  double *directions;     /**< [M, 3] unit */
  double *displacement;   /**< [M, N, 3] mm */
} supine_fields;

/** Read a safetensors file with gravity [M, 3] and displacement [M, N, 3], F32 or F64, in the order
 * of the reference surface's vertices.
 *
 * @param lungs    the reference surface
 * @param options  axes and unit of the displacements
 * @param fields   release with supine_fields_free
 * @retval SUPINE_ERROR_READ    the file is missing
 * @retval SUPINE_ERROR_FORMAT  malformed; a direction that is zero or not finite, or a displacement
 * that is not finite
 * @retval SUPINE_ERROR_MESH    the number of vertices differs from that of the lungs
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_fields_load(const char *path, const supine_lungs *lungs,
                                 const supine_mesh_load_options *options, supine_fields *fields,
                                 supine_error *error);
void supine_fields_free(supine_fields *fields);

enum { SUPINE_FIT_BAND_MAX = 11 };

/** Result of a fit. */
typedef struct supine_fit_report {
  size_t band_highest; /**< highest band that the directions determine */
  size_t band;         /**< chosen band */
  double condition;    /**< condition number of the band's harmonics at the directions */
  size_t mode_count;   /**< number of modes of the basis; set by supine_precompute_fields */
  double error[SUPINE_FIT_BAND_MAX + 1]; /**< leave-one-out error of each band up to band_highest,
                                          * relative RMS */
  supine_accuracy accuracy; /**< leave-one-out error of the basis; errors in mm are those at the
                             * given displacements, and volume is 0 */
} supine_fit_report;

/** Options of the fit. */
typedef struct supine_fit_options {
  int band;             /**< negative: chosen by the leave-one-out error */
  size_t modes;         /**< largest number of modes; 0: the harmonics themselves */
  const char *findings; /**< notes on the surface for the basis, one a line; optional */
  const char *made_by;  /**< for the basis's metadata; optional */
} supine_fit_options;

/** Fit the fields, compress and cross-validate.
 *
 * @param compression  written; its 3 N rows are the components of each vertex. Release with
 *                     supine_projection_compression_free
 * @retval SUPINE_ERROR_ARGUMENT   a band that the directions do not determine, fewer than two
 *         directions
 * @retval SUPINE_ERROR_NUMERICAL  the displacements are all zero, or a decomposition failed
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_fields_fit(const supine_fields *fields, const supine_fit_options *options,
                                supine_compression *compression, supine_fit_report *report,
                                supine_error *error);

#endif
