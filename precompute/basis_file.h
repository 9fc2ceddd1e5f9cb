/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file Write a basis file. */
#ifndef SUPINE_BASIS_FILE_H
#define SUPINE_BASIS_FILE_H

#include "precompute/precompute.h"

#include "precompute/projection/accuracy.h"

/** Content of a basis file, with N vertices and G lungs. */
typedef struct supine_basis_content {
  const supine_lungs *lungs;
  const supine_precompute_options *options; /**< with `fit`: only modes, findings and made_by */
  const supine_fit_report *fit; /**< fit of another simulator's fields; NULL: field of a model */
  const double *directions;     /**< [N, 3] mm; NULL: coefficients are vectors */
  const supine_compression *compression;
  const supine_volume_forms *forms; /**< volumes as polynomials of the coefficients */
  const supine_accuracy *accuracy;
  const supine_reference *reference; /**< volumes of the lungs; NULL: rest and full are unknown */
  const double *resting;             /**< [G, 9] harmonics of the volumes at rest, mL beyond the
                                          reference surface; NULL without `reference` */
  const double *turned_over;         /**< result of supine_accuracy_turned_over, or NULL */
  const supine_error_table *table;   /**< NULL: no table is written */
} supine_basis_content;

/** Write a basis file, whole or not at all.
 * @retval SUPINE_ERROR_WRITE, SUPINE_ERROR_MEMORY */
supine_status supine_writer_basis_write(const char *path, const supine_basis_content *content,
                                        supine_error *error);

#endif
