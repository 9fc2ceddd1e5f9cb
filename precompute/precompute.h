/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Make a basis from lungs. from_model.c and from_fields.c list the steps. */
#ifndef SUPINE_PRECOMPUTE_H
#define SUPINE_PRECOMPUTE_H

#include "precompute/basis_file.h"

typedef struct supine_basis_report {
  size_t band, mode_count;
  size_t cluster_count; /**< 0 if the basis stores modes */
  supine_accuracy accuracy;
  double turned_over;    /**< share of triangles, 0 to 1 (supine_projection_turned_over) */
  supine_fit_report fit; /**< of another simulator's fields */
} supine_basis_report;

/** Make a basis from lungs and their model, or from lungs and another simulator's fields, and
 * measure its error. Fields displace the lungs without scaling: gain 1 reproduces them.
 * @param bytes   the content of the basis file; release it with free(), also after an error
 * @param report  optional */
supine_status supine_precompute(const supine_prepared *prepared, const supine_basis_choice *choice,
                                supine_bytes *bytes, supine_basis_report *report,
                                supine_error *error);

/** Write a basis file atomically: a failure leaves no partial file. */
supine_status supine_precompute_save(const char *path, const supine_bytes *bytes,
                                     supine_error *error);

#endif
