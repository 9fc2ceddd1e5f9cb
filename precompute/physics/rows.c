/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Building sparse matrices row by row. */
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "precompute/physics/rows.h"
#include "sh/base/parallel.h"

enum { ROWS_GRAIN = 1024 };

void supine_physics_rows_free(supine_rows *rows) {
  free(rows->begin);
  free(rows->column);
  free(rows->value);
  *rows = (supine_rows){0};
}

static supine_status allocate_entries(supine_rows *rows, size_t entries) {
  rows->column = malloc((entries + 1) * sizeof *rows->column);
  rows->value = malloc((entries + 1) * sizeof *rows->value);
  return rows->column == NULL || rows->value == NULL ? SUPINE_ERROR_MEMORY : SUPINE_OK;
}

/* Numbers of entries, in the place after each row's, to the rows' beginnings. */
static void add_up(supine_rows *rows) {
  rows->begin[0] = 0;
  for (size_t i = 0; i < rows->count; ++i) {
    rows->begin[i + 1] += rows->begin[i];
  }
}

typedef struct build_work {
  supine_row_function *sum;
  const void *context;
  supine_rows *rows;
  supine_row *scratch; /* one a thread */
} build_work;

/* Counts the entries of each row, or where there is space for them writes them. */
static void build_range(void *context, size_t begin, size_t end, size_t thread) {
  const build_work *work = context;
  supine_rows *rows = work->rows;
  supine_row *row = &work->scratch[thread];
  for (size_t i = begin; i < end; ++i) {
    row->count = 0;
    work->sum(work->context, i, row);
    for (size_t k = 0; k < row->count; ++k) {
      row->place[row->column[k]] = UINT32_MAX;
      if (rows->value != NULL) {
        rows->column[rows->begin[i] + k] = row->column[k];
        rows->value[rows->begin[i] + k] = (float)row->value[k];
      }
    }
    if (rows->value == NULL) {
      rows->begin[i + 1] = row->count;
    }
  }
}

supine_status supine_physics_rows_build(size_t count, size_t columns, supine_row_function *sum,
                                        const void *context, supine_rows *rows) {
  const size_t threads = supine_thread_count();
  supine_rows made = {.count = count, .begin = calloc(count + 1, sizeof *made.begin)};
  supine_row *scratch = calloc(threads, sizeof *scratch);
  build_work work = {sum, context, &made, scratch};
  supine_status status = SUPINE_ERROR_MEMORY;
  bool whole = made.begin != NULL && scratch != NULL;
  for (size_t t = 0; t < threads && whole; ++t) {
    scratch[t].column = malloc((columns + 1) * sizeof *scratch[t].column);
    scratch[t].value = malloc((columns + 1) * sizeof *scratch[t].value);
    scratch[t].place = malloc((columns + 1) * sizeof *scratch[t].place);
    whole = scratch[t].column != NULL && scratch[t].value != NULL && scratch[t].place != NULL;
    if (whole) {
      memset(scratch[t].place, 0xff, columns * sizeof *scratch[t].place);
    }
  }
  if (whole) {
    supine_parallel_for(count, ROWS_GRAIN, threads, build_range, &work);
    add_up(&made);
    status = allocate_entries(&made, made.begin[count]);
  }
  if (status == SUPINE_OK) {
    supine_parallel_for(count, ROWS_GRAIN, threads, build_range, &work);
    *rows = made;
  } else {
    supine_physics_rows_free(&made);
  }
  for (size_t t = 0; t < threads && scratch != NULL; ++t) {
    free(scratch[t].column);
    free(scratch[t].value);
    free(scratch[t].place);
  }
  free(scratch);
  return status;
}

supine_status supine_physics_rows_transpose(const supine_rows *rows, size_t columns,
                                            supine_rows *transposed) {
  const size_t entries = rows->begin[rows->count];
  supine_rows made = {.count = columns, .begin = calloc(columns + 1, sizeof *made.begin)};
  if (made.begin == NULL || allocate_entries(&made, entries) != SUPINE_OK) {
    supine_physics_rows_free(&made);
    return SUPINE_ERROR_MEMORY;
  }
  for (size_t s = 0; s < entries; ++s) {
    ++made.begin[rows->column[s] + 1];
  }
  add_up(&made);
  for (size_t i = rows->count; i-- > 0;) { /* filled from the ends, which become beginnings */
    for (size_t s = rows->begin[i + 1]; s-- > rows->begin[i];) {
      const size_t at = --made.begin[rows->column[s] + 1];
      made.column[at] = (uint32_t)i;
      made.value[at] = rows->value[s];
    }
  }
  memmove(made.begin, made.begin + 1, columns * sizeof *made.begin);
  made.begin[columns] = entries;
  *transposed = made;
  return SUPINE_OK;
}
