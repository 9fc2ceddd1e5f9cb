/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Sparse matrices in compressed rows. */
#ifndef SUPINE_ROWS_H
#define SUPINE_ROWS_H

#include <stddef.h>
#include <stdint.h>

#include <supine/status.h>

/* Row i is column[s], value[s] for begin[i] <= s < begin[i + 1]. */
typedef struct supine_rows {
  size_t count;
  size_t *begin; /* [count + 1] */
  uint32_t *column;
  float *value;
} supine_rows;

void supine_physics_rows_free(supine_rows *rows);

/* One row while it is summed: as many columns as were named, in the order of their first naming. */
typedef struct supine_row {
  size_t count;
  uint32_t *column;
  double *value;
  uint32_t *place; /* of each column of the matrix: where in the row, UINT32_MAX: not in it */
} supine_row;

/* Adds to one entry of a row. */
static inline void supine_physics_row_add(supine_row *row, uint32_t column, double value) {
  if (row->place[column] == UINT32_MAX) {
    row->place[column] = (uint32_t)row->count;
    row->column[row->count] = column;
    row->value[row->count++] = 0.0;
  }
  row->value[row->place[column]] += value;
}

/* Sums row i. */
typedef void supine_row_function(const void *context, size_t i, supine_row *row);

/* The matrix of `count` rows whose entries `sum` adds up; called in threads.
 * The same matrix for any number of them.
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_physics_rows_build(size_t count, size_t columns, supine_row_function *sum,
                                        const void *context, supine_rows *rows);

/* The transpose of a matrix of `columns` columns.
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_physics_rows_transpose(const supine_rows *rows, size_t columns,
                                            supine_rows *transposed);

#endif
