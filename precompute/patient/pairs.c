/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Read matched points. */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "precompute/patient/pairs.h"

#include "sh/base/csv.h"

enum { COLUMNS = 12, COORDINATES = 6 };

static const char *const columns[COLUMNS] = {"x",     "y",     "z",     "to_x",  "to_y",  "to_z",
                                             "im1_x", "im1_y", "im1_z", "im2_x", "im2_y", "im2_z"};

/* A point and its line number, to find duplicates. */
typedef struct placed {
  const double *point;
  size_t line;
} placed;

static int compare_points(const void *a, const void *b) {
  const double *p = ((const placed *)a)->point;
  const double *q = ((const placed *)b)->point;
  for (int k = 0; k < 3; ++k) {
    if (p[k] != q[k]) {
      return p[k] < q[k] ? -1 : 1;
    }
  }
  return 0;
}

static supine_status refuse_doubles(const char *path, const double *points, const size_t *lines,
                                    size_t count, supine_error *error) {
  placed *sorted = malloc(count * sizeof *sorted);
  if (sorted == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu points", count);
  }
  for (size_t i = 0; i < count; ++i) {
    sorted[i] = (placed){points + 3 * i, lines[i]};
  }
  qsort(sorted, count, sizeof *sorted, compare_points);
  supine_status status = SUPINE_OK;
  for (size_t i = 1; i < count && status == SUPINE_OK; ++i) {
    if (compare_points(&sorted[i - 1], &sorted[i]) == 0) {
      const double *p = sorted[i].point;
      status =
          supine_error_set(error, SUPINE_ERROR_FORMAT,
                           "%s: lines %zu and %zu both give the point %g,%g,%g: keep one of them",
                           path, sorted[i - 1].line, sorted[i].line, p[0], p[1], p[2]);
    }
  }
  free(sorted);
  return status;
}

/* Find the six columns of the two points, the one at rest first. */
static supine_status find_columns(const supine_csv *csv, bool reverse, size_t column[COORDINATES],
                                  supine_error *error) {
  const size_t first = supine_csv_text(csv, 0) != NULL ? 0 : COORDINATES;
  const bool swap = (first == COORDINATES) != reverse; /* image 2 is at rest */
  for (size_t k = 0; k < COORDINATES; ++k) {
    column[k] = first + (swap ? (k + 3) % COORDINATES : k);
    if (supine_csv_text(csv, first + k) == NULL) {
      return supine_error_set(error, SUPINE_ERROR_FORMAT,
                              "%s:%zu: the header has no column \"%s\"; expected "
                              "x,y,z,to_x,to_y,to_z or im1_x,im1_y,im1_z,im2_x,im2_y,im2_z",
                              csv->path, csv->line, columns[first + k]);
    }
  }
  return SUPINE_OK;
}

static supine_status read_rows(supine_csv *csv, bool reverse, supine_patient_pairs *pairs,
                               size_t **lines, supine_error *error) {
  size_t capacity = 0;
  size_t column[COORDINATES];
  supine_status status = find_columns(csv, reverse, column, error);
  bool more = status == SUPINE_OK;
  while (more && status == SUPINE_OK &&
         (status = supine_csv_next(csv, &more, error)) == SUPINE_OK && more) {
    if (pairs->count == capacity) {
      capacity = capacity == 0 ? 512 : 2 * capacity;
      double *from = realloc(pairs->from, 3 * capacity * sizeof *from);
      pairs->from = from != NULL ? from : pairs->from;
      double *to = realloc(pairs->to, 3 * capacity * sizeof *to);
      pairs->to = to != NULL ? to : pairs->to;
      size_t *line = realloc(*lines, capacity * sizeof *line);
      *lines = line != NULL ? line : *lines;
      if (from == NULL || to == NULL || line == NULL) {
        return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu points", capacity);
      }
    }
    for (size_t k = 0; k < COORDINATES && status == SUPINE_OK; ++k) {
      double *point = (k < 3 ? pairs->from : pairs->to) + 3 * pairs->count;
      status = supine_csv_number(csv, column[k], columns[column[k]], &point[k % 3], error);
    }
    (*lines)[pairs->count++] = csv->line;
  }
  return status;
}

supine_status supine_patient_pairs_load(const char *path, bool reverse, supine_patient_pairs *pairs,
                                        supine_error *error) {
  supine_csv csv;
  supine_patient_pairs made = {0};
  size_t *lines = NULL;
  supine_status status = supine_csv_open(path, columns, COLUMNS, 0, &csv, error);
  if (status != SUPINE_OK) {
    return status;
  }
  status = read_rows(&csv, reverse, &made, &lines, error);
  if (status == SUPINE_OK && made.count == 0) {
    status = supine_error_set(error, SUPINE_ERROR_FORMAT,
                              "%s: no pairs of points: give one in each line", path);
  }
  if (status == SUPINE_OK) {
    status = refuse_doubles(path, made.from, lines, made.count, error);
  }
  if (status == SUPINE_OK) {
    *pairs = made;
    made = (supine_patient_pairs){0};
  }
  free(lines);
  supine_patient_pairs_free(&made);
  supine_csv_close(&csv);
  return status;
}

void supine_patient_pairs_free(supine_patient_pairs *pairs) {
  free(pairs->from);
  free(pairs->to);
  free(pairs->side);
  *pairs = (supine_patient_pairs){0};
}

void supine_patient_pairs_swap(supine_patient_pairs *pairs) {
  double *from = pairs->from;
  pairs->from = pairs->to;
  pairs->to = from;
}
