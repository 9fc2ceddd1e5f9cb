/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file Print a basis file. */
#ifndef SUPINE_BASIS_FILE_H
#define SUPINE_BASIS_FILE_H

#include "precompute/fields/storage.h"
#include "precompute/prepare.h"
#include "precompute/projection/accuracy.h"

/** Bytes in memory, which free() releases. */
typedef struct supine_bytes {
  char *data;
  size_t size;
} supine_bytes;

/** Content of a basis file with N vertices. */
typedef struct supine_basis_content {
  const supine_lungs *lungs;
  const supine_prepared *prepared; /**< texts and model; the laws are unused if `is_fields` */
  supine_rows rows;                /**< kind of the rows of `compression`, for healthy lungs */
  const supine_compression *compression;
  const supine_volume_forms *forms;
  supine_accuracy *accuracy;         /**< the error of storage is added to it */
  const supine_reference *reference; /**< NULL if the resting volume (FRC) is unknown */
  /** [lungs, 9] resting volume (FRC) minus the volume of the reference surface, mL: coefficients of
   * spherical harmonics of the direction of gravity, to degree 2; NULL if `reference` is NULL */
  const double *resting;
  const double *turned_over;       /**< share of triangles that turn over, or NULL if unknown */
  const supine_error_table *table; /**< NULL if `is_fields` */
  bool is_fields;                  /**< whether another simulator computed the displacements */
  const supine_fit *fit;           /**< of these displacements, if `is_fields` */
  const supine_clusters *clusters; /**< `count` is 0 if the basis stores modes */
  const float *exact;         /**< [rows, modes] coefficients of `compression` before clusters */
  const double *scan_gravity; /**< if so, [3] gravity in the scan, or NULL if unknown */
  bool is_harmonics;          /**< whether the modes are the harmonics themselves */
  bool without_normals;
  const char *made_by; /**< command line that makes the basis, or NULL */
} supine_basis_content;

/** Add the error of storage to content->accuracy, and print the basis file.
 * @param bytes  release bytes->data with free(), also after an error */
supine_status supine_precompute_print(const supine_basis_content *content, supine_bytes *bytes,
                                      supine_error *error);

#endif
