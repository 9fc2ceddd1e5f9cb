/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file Write a basis file. */
#ifndef SUPINE_BASIS_FILE_H
#define SUPINE_BASIS_FILE_H

#include "precompute/precompute.h"

#include "precompute/projection/accuracy.h"

/** Content of a basis file. */
typedef struct supine_basis_content {
  const supine_lungs *lungs;
  const supine_precompute_options *options; /**< with `fit`: modes, findings and made_by */
  const supine_fit_report *fit; /**< fit of another simulator's fields; NULL: a model's field */
  const double *directions;     /**< [N, 3]; NULL: a vector field */
  const supine_compression *compression;
  const supine_volume_forms *forms; /**< forms of the coefficients */
  const supine_accuracy *accuracy;
  const supine_reference *reference; /**< volumes of the lungs; NULL: rest and full are unknown */
  const double *resting;             /**< [G, 9] harmonics of the volumes at rest, mL beyond the
                                          reference surface; NULL without `reference` */
  const double *turned_over;         /**< share of triangles, see supine_accuracy_turned_over;
                                          optional */
  const supine_error_table *table;   /**< optional */
} supine_basis_content;

/** Write a basis file, whole or not at all.
 * @retval SUPINE_ERROR_WRITE, SUPINE_ERROR_MEMORY */
supine_status supine_writer_basis_write(const char *path, const supine_basis_content *content,
                                        supine_error *error);

#endif
