/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute expandability by a regional model ([Santhanam2008] III-E), or read it from a file. */
#include <math.h>
#include <string.h>

#include "base/arena.h"
#include "base/csv.h"

#include "precompute/lungs/expandability.h"

void supine_lungs_expandability_regional(const supine_lungs *lungs,
                                         const supine_expandability_law *law, double *a) {
  for (size_t i = 0; i < lungs->mesh.vertex_count; ++i) {
    double box[3];
    supine_lungs_box_coordinates(lungs, i, box);
    const double t = box[law->axis];
    a[i] = law->shape == SUPINE_EXPANDABILITY_LINEAR ? law->from + (law->to - law->from) * t
                                                     : law->from * pow(law->to / law->from, t);
  }
}

/* Store the expandability in a CSV row for the vertex in its column `vertex` or, without that
 * column, for vertex `row`. Elements of a [count] are 0 for vertices without a value so far. */
static supine_status take_row(const supine_csv *csv, size_t row, size_t count, double *a,
                              supine_error *error) {
  double number = (double)row;
  double value = 0.0;
  if (supine_csv_text(csv, 1) != NULL) {
    SUPINE_TRY(supine_csv_number(csv, 1, "vertex", &number, error));
  }
  SUPINE_TRY(supine_csv_number(csv, 0, "expandability", &value, error));
  const bool there = number >= 0.0 && number < (double)count && number == floor(number);
  const size_t vertex = there ? (size_t)number : 0;
  const bool positive = value > 0.0 && isfinite(value) && isfinite(1.0 / value);
  const char *wrong = NULL;
  if (!there) {
    wrong = "there is no such vertex";
  } else if (!positive) {
    wrong = "it must be positive";
  } else if (a[vertex] != 0.0) {
    wrong = "the vertex was given before";
  }
  SUPINE_REFUSE_IF(wrong != NULL, error, SUPINE_ERROR_FORMAT,
                   "%s:%zu: expandability %g of vertex %.15g: %s; give one positive value for each "
                   "of %zu vertices, counted from 0",
                   csv->path, csv->line, value, number, wrong, count);
  a[vertex] = value;
  return SUPINE_OK;
}

supine_status supine_lungs_expandability_load(const char *path, size_t count, double *a,
                                              supine_error *error) {
  static const char *const columns[] = {"expandability", "vertex"};
  SUPINE_FREED_BY(supine_csv_close) supine_csv csv;
  SUPINE_TRY(supine_csv_open(path, columns, 2, 1, &csv, error));
  memset(a, 0, count * sizeof *a);
  bool more = true;
  for (size_t row = 0;; ++row) {
    SUPINE_TRY(supine_csv_next(&csv, &more, error));
    if (!more) {
      break;
    }
    SUPINE_TRY(take_row(&csv, row, count, a, error));
  }
  for (size_t i = 0; i < count; ++i) {
    SUPINE_REFUSE_IF(a[i] == 0.0, error, SUPINE_ERROR_FORMAT,
                     "%s: vertex %zu of %zu has no value: add its expandability", path, i, count);
  }
  return SUPINE_OK;
}
