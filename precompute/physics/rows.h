/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Kinds of displacement fields: what a row of coefficients describes. */
#ifndef SUPINE_ROWS_H
#define SUPINE_ROWS_H

#include <stddef.h>

typedef enum supine_rows_kind {
  SUPINE_ROWS_SCALAR, /**< a row for each vertex: its displacement as a multiple of a direction */
  SUPINE_ROWS_VECTOR  /**< three rows for each vertex: the coordinates of its displacement, mm */
} supine_rows_kind;

typedef struct supine_rows {
  supine_rows_kind kind;
  /** SCALAR: [N, 3] displacement of each vertex per unit of its row, mm. VECTOR: unused. */
  const double *directions;
} supine_rows;

/** Return the number of rows of each vertex. */
static inline size_t supine_rows_per_vertex(supine_rows_kind kind) {
  return kind == SUPINE_ROWS_VECTOR ? 3 : 1;
}

#endif
