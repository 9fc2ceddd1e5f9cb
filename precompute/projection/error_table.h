/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Tabulate the error by the number of functions, from which a user can choose it. */
#ifndef SUPINE_ERROR_TABLE_H
#define SUPINE_ERROR_TABLE_H

#include "precompute/projection/accuracy.h"

/* Relative RMS errors on the held-out directions, over at most 4096 evenly chosen vertices. */
typedef struct supine_error_table {
  size_t band_count; /* L + 1 */
  double *harmonics; /* [L + 1] error with the first (l + 1)^2 harmonics */
  size_t mode_count; /* K */
  double *modes;     /* [K] error with the first k + 1 modes */
} supine_error_table;

supine_status supine_accuracy_error_table_create(const supine_truth *truth,
                                                 const supine_projection *projection,
                                                 const supine_compression *compression,
                                                 const double *directions,
                                                 supine_error_table *table);
void supine_accuracy_error_table_free(supine_error_table *table);

#endif
