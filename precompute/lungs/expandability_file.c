/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Expandability from a file: a value a line, or a vertex and its value. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sh/base/csv.h"

#include "precompute/lungs/expandability.h"

/* The vertex that a row names in its first field; false where it names none. */
static bool parse_vertex(const char *text, size_t *vertex) {
  char *end = NULL;
  errno = 0;
  *vertex = (size_t)strtoull(text, &end, 10);
  return end != text && *end == '\0' && errno == 0 && text[0] != '-';
}

/* Takes a row; a value of 0 in `a` is one that has not come yet. */
static supine_status take_row(const supine_csv *csv, size_t row, size_t count, double *a,
                              supine_error *error) {
  const size_t last = csv->column_count - 1;
  size_t vertex = row;
  double value = 0.0;
  if (last == 1 && !parse_vertex(csv->field[0], &vertex)) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "%s:%zu: '%.40s' is not a number of a vertex (a line is a value, or "
                            "vertex,value)",
                            csv->path, csv->line, csv->field[0]);
  }
  const supine_status status = supine_csv_number(csv, last, "expandability", &value, error);
  if (status != SUPINE_OK) {
    return status;
  }
  const char *wrong = vertex >= count                            ? "is none of the model's"
                      : !(value > 0.0) || !isfinite(1.0 / value) ? "must be positive"
                      : a[vertex] != 0.0                         ? "is there already"
                                                                 : NULL;
  if (wrong != NULL) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "%s:%zu: expandability %g of vertex %zu %s (%zu vertices, counted from "
                            "0)",
                            csv->path, csv->line, value, vertex, wrong, count);
  }
  a[vertex] = value;
  return SUPINE_OK;
}

static supine_status take_rows(supine_csv *csv, size_t count, double *a, supine_error *error) {
  char *end = NULL;
  (void)strtod(csv->field[0], &end);
  if (end != csv->field[0] || csv->column_count > 2) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "%s:%zu: a header line must come first: 'expandability', or "
                            "'vertex,expandability'",
                            csv->path, csv->line);
  }
  bool more = true;
  supine_status status = SUPINE_OK;
  memset(a, 0, count * sizeof *a);
  for (size_t row = 0; status == SUPINE_OK; ++row) {
    status = supine_csv_next(csv, &more, error);
    if (status != SUPINE_OK || !more) {
      break;
    }
    status = take_row(csv, row, count, a, error);
  }
  for (size_t i = 0; i < count && status == SUPINE_OK; ++i) {
    if (a[i] == 0.0) {
      status = supine_error_set(error, SUPINE_ERROR_FORMAT,
                                "%s: vertex %zu of %zu has no expandability", csv->path, i, count);
    }
  }
  return status;
}

supine_status supine_tissue_expandability_load(const char *path, size_t count, double *a,
                                               supine_error *error) {
  supine_csv csv;
  supine_status status = supine_csv_open(path, NULL, 0, 0, &csv, error);
  if (status == SUPINE_OK) {
    status = take_rows(&csv, count, a, error);
    supine_csv_close(&csv);
  }
  return status;
}
