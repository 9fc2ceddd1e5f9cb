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

/* What one thread has summed: consecutive rows. */
typedef struct piece {
  supine_row row;
  size_t first, count, space;
  uint32_t *column;
  float *value;
  bool full; /* of memory */
} piece;

typedef struct build_work {
  supine_row_function *sum;
  const void *context;
  supine_rows *rows;
  piece *pieces; /* one a thread */
} build_work;

static bool piece_create(size_t columns, piece *made) {
  supine_row *row = &made->row;
  row->column = malloc((columns + 1) * sizeof *row->column);
  row->value = malloc((columns + 1) * sizeof *row->value);
  row->place = malloc((columns + 1) * sizeof *row->place);
  if (row->column == NULL || row->value == NULL || row->place == NULL) {
    return false;
  }
  memset(row->place, 0xff, columns * sizeof *row->place);
  return true;
}

static void piece_free(piece *made) {
  free(made->row.column);
  free(made->row.value);
  free(made->row.place);
  free(made->column);
  free(made->value);
}

/* Room for one more row. */
static bool piece_grow(piece *to) {
  const size_t wanted = to->count + to->row.count;
  if (wanted <= to->space) {
    return true;
  }
  const size_t space = 2 * wanted;
  uint32_t *column = realloc(to->column, space * sizeof *column);
  to->column = column != NULL ? column : to->column;
  float *value = realloc(to->value, space * sizeof *value);
  to->value = value != NULL ? value : to->value;
  to->space = column != NULL && value != NULL ? space : to->space;
  return to->space == space;
}

static void build_range(void *context, size_t begin, size_t end, size_t thread) {
  const build_work *work = context;
  piece *to = &work->pieces[thread];
  supine_row *row = &to->row;
  to->first = begin;
  for (size_t i = begin; i < end && !to->full; ++i) {
    row->count = 0;
    work->sum(work->context, i, row);
    to->full = !piece_grow(to);
    for (size_t k = 0; k < row->count; ++k) {
      row->place[row->column[k]] = UINT32_MAX;
      if (!to->full) {
        to->column[to->count + k] = row->column[k];
        to->value[to->count + k] = (float)row->value[k];
      }
    }
    to->count += to->full ? 0 : row->count;
    work->rows->begin[i + 1] = row->count;
  }
}

supine_status supine_physics_rows_build(size_t count, size_t columns, supine_row_function *sum,
                                        const void *context, supine_rows *rows) {
  const size_t threads = supine_thread_count();
  supine_rows made = {.count = count, .begin = calloc(count + 1, sizeof *made.begin)};
  piece *pieces = calloc(threads, sizeof *pieces);
  build_work work = {sum, context, &made, pieces};
  bool whole = made.begin != NULL && pieces != NULL;
  for (size_t t = 0; t < threads && whole; ++t) {
    whole = piece_create(columns, &pieces[t]);
  }
  if (whole) {
    supine_parallel_for(count, ROWS_GRAIN, threads, build_range, &work);
  }
  for (size_t t = 0; t < threads && whole; ++t) {
    whole = !pieces[t].full;
  }
  if (whole) {
    add_up(&made);
    whole = allocate_entries(&made, made.begin[count]) == SUPINE_OK;
  }
  for (size_t t = 0; t < threads && pieces != NULL; ++t) {
    if (whole && pieces[t].count > 0) {
      const size_t at = made.begin[pieces[t].first];
      memcpy(made.column + at, pieces[t].column, pieces[t].count * sizeof *made.column);
      memcpy(made.value + at, pieces[t].value, pieces[t].count * sizeof *made.value);
    }
    piece_free(&pieces[t]);
  }
  free(pieces);
  if (!whole) {
    supine_physics_rows_free(&made);
    return SUPINE_ERROR_MEMORY;
  }
  *rows = made;
  return SUPINE_OK;
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
