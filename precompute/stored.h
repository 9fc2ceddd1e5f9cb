/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file Round what was computed as a basis file stores it, and measure what depends on rounding.
 */
#ifndef SUPINE_STORED_H
#define SUPINE_STORED_H

#include "precompute/computed.h"
#include "precompute/normals/normal_modes.h"

/** Arrays of a basis file of N vertices, as they are stored. */
typedef struct supine_stored {
  float *vertices;          /**< [N, 3] */
  float *directions;        /**< [N, 3] of SCALAR rows, otherwise NULL */
  unsigned char *lung;      /**< [N] */
  supine_compression field; /**< coefficients for collapsed lungs */
  supine_rows rows;         /**< of `field`, in double precision */
  double *hilum; /**< [lungs, 3, modes] mean displacement of each hilum by each mode, mm; NULL if no
                    lung is collapsed */
  supine_normals_modes normals;
  supine_simulated_volumes simulated;                /**< of fields over volume */
  double shares[2 * 9 * (SUPINE_FIT_ORDER_MAX + 1)]; /**< simulated.shares without gaps */
  double named[2][2][9];     /**< harmonics of rest and of full inflation, of fields over volume */
  const double *rest, *full; /**< [lungs, 9] harmonics of these volumes, mL above the surface; NULL
                                if unknown */
  double *volume_range; /**< [SUPINE_RANGE_NODES, lungs, 2] volumes without folds, mL, or NULL */
} supine_stored;

/** Collapse the lungs and their displacements, round them, and find the modes of their normals.
 * @param arena   of the arrays
 * @param stored  written */
supine_status supine_precompute_store(const supine_prepared *prepared,
                                      const supine_basis_choice *choice,
                                      const supine_computed *computed, supine_arena *arena,
                                      supine_stored *stored, supine_error *error);

/** Measure a basis file that was printed from `stored`: add the error of storage to
 * computed->accuracy, and find the volumes that the lungs can hold or, of fields over volume, those
 * of rest and full inflation, into `stored`.
 * @param bytes  [size] the file */
supine_status supine_precompute_measure_stored(const supine_prepared *prepared, const void *bytes,
                                               size_t size, supine_computed *computed,
                                               supine_arena *arena, supine_stored *stored,
                                               supine_error *error);

#endif
