/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Error against the number of functions, for the user to choose by. */
#ifndef SUPINE_ERROR_TABLE_H
#define SUPINE_ERROR_TABLE_H

#include "precompute/projection/accuracy.h"

/* Relative RMS errors on the held-out directions, over at most 4096 vertices spread over the file.
 */
typedef struct supine_error_table {
  size_t band_count; /* L + 1 */
  double *harmonics; /* [L + 1] of the (l + 1)^2 first harmonics */
  size_t mode_count;
  double *modes; /* [K] of the k + 1 first modes */
} supine_error_table;

supine_status supine_accuracy_error_table_create(const supine_truth *truth,
                                                 const supine_projection *projection,
                                                 const supine_compression *compression,
                                                 const double *directions,
                                                 supine_error_table *table);
void supine_accuracy_error_table_free(supine_error_table *table);

#endif
