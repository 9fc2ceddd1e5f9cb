/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Fields that another simulator computed: displacements of one surface for some directions of
 * gravity, fitted by harmonics and compressed to a basis.
 *
 *     minimise over C:  sum over directions j of |u(g_j) - C Y(g_j)|^2
 *
 * Directions on a Gauss-Legendre x equispaced grid go through the transform instead; that is the
 * same fit, weighted by the rule. The band is the one whose leave-one-out error is least, among
 * those that the directions determine. */
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

/** Reads a list (CSV with the columns gx,gy,gz,file: deformed surfaces of the same topology, named
 * relative to the list) or a safetensors file with gravity [M, 3] and displacement [M, N, 3], F32
 * or F64, in the order of the rest surface's vertices.
 *
 * @param lungs    the rest surface; deformed surfaces are joined and grouped as it was
 * @param options  axes and units of the deformed surfaces, or of a safetensors' displacements
 * @retval SUPINE_ERROR_READ    a file is missing
 * @retval SUPINE_ERROR_FORMAT  a malformed list or file, a direction that is zero or not finite, a
 * displacement that is not finite, two equal directions (line or row named)
 * @retval SUPINE_ERROR_MESH    a surface of another topology
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_fields_load(const char *path, const supine_lungs *lungs,
                                 const supine_mesh_load_options *options, supine_fields *fields,
                                 supine_error *error);
void supine_fields_free(supine_fields *fields);

/** What a fit's directions can carry. */
typedef struct supine_fit_report {
  bool grid;           /**< the directions are a product grid */
  size_t band_highest; /**< highest band that the directions determine */
  double condition;    /**< of the harmonics at the directions, at the band that was chosen */
  size_t band;         /**< the band that was chosen */
  double error[12];    /**< leave-one-out error of each band up to band_highest, relative RMS */
  double scalar_loss;  /**< what magnitude x best direction loses, relative RMS; 0 for vectors */
  supine_accuracy accuracy; /**< leave-one-out; mm are those of the fields as given, volume 0 */
} supine_fit_report;

enum { SUPINE_FIT_BAND_MAX = 11 };

/** What a fit is asked for. */
typedef struct supine_fit_options {
  bool scalar;          /**< magnitude x best direction instead of three components */
  int band;             /**< wanted; negative: chosen */
  size_t modes;         /**< most modes; 0: the harmonics */
  const char *findings; /**< what was found of the surface, a line each, for the basis; optional */
} supine_fit_options;

/** Fits, compresses, cross-validates.
 *
 * @param directions   [N, 3] written: the best direction of each vertex (unit), scalar fields alone
 * @param compression  rows are vertices (scalar), or vertices x components (vector: 3 N rows)
 * @retval SUPINE_ERROR_ARGUMENT   a band that the directions do not determine, fewer than two
 * directions
 * @retval SUPINE_ERROR_NUMERICAL  nothing moves
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_fields_fit(const supine_fields *fields, const supine_fit_options *options,
                                double *directions, supine_compression *compression,
                                supine_fit_report *report, supine_error *error);

#endif
