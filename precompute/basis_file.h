/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file Write a basis file. */
#ifndef SUPINE_BASIS_FILE_H
#define SUPINE_BASIS_FILE_H

#include "precompute/precompute.h"

#include "precompute/projection/accuracy.h"

/** Content of a basis file, with N vertices and G lungs. */
typedef struct supine_basis_content {
  const supine_lungs *lungs;
  const supine_precompute_options *options; /**< options->model is unused if `fit` is not NULL */
  const supine_fit_report *fit;             /**< NULL if the basis is made from a physical model */
  const double *directions; /**< [N, 3] displacement directions, mm; NULL for vector fields */
  const supine_compression *compression;
  const supine_volume_forms *forms;
  const supine_accuracy *accuracy;
  const supine_reference *reference; /**< NULL if the volume at rest is unknown */
  /** [G, 9] volume of each lung at rest minus that of its reference surface, mL, as harmonics of
   * the direction of gravity; NULL if `reference` is NULL */
  const double *resting;
  const double *turned_over;       /**< share of triangles that turn over, or NULL */
  const supine_error_table *table; /**< may be NULL */
} supine_basis_content;

/** Write a basis file, whole or not at all.
 * @retval SUPINE_ERROR_WRITE, SUPINE_ERROR_MEMORY */
supine_status supine_writer_basis_write(const char *path, const supine_basis_content *content,
                                        supine_error *error);

#endif
