/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Read directions of displacement from a file. */
#include "precompute/physics/force.h"

#include "sh/base/csv.h"

supine_status supine_physics_directions_load(const char *path, size_t count, double *vectors,
                                             supine_error *error) {
  static const char *const columns[] = {"dx", "dy", "dz"};
  supine_csv csv;
  bool more = true;
  size_t rows = 0;
  supine_status status = supine_csv_open(path, columns, 3, 3, &csv, error);
  while (status == SUPINE_OK && more) {
    status = supine_csv_next(&csv, &more, error);
    if (status == SUPINE_OK && more && rows == count) {
      status = supine_error_set(error, SUPINE_ERROR_FORMAT,
                                "%s:%zu: more rows than the model has vertices (%zu)", path,
                                csv.line, count);
    }
    for (size_t k = 0; k < 3 && status == SUPINE_OK && more; ++k) {
      status = supine_csv_number(&csv, k, columns[k], vectors + 3 * rows + k, error);
    }
    rows += more ? 1 : 0;
  }
  supine_csv_close(&csv);
  if (status == SUPINE_OK && rows < count) {
    status = supine_error_set(
        error, SUPINE_ERROR_FORMAT,
        "%s: %zu rows, but the model has %zu vertices: give one row for each vertex", path, rows,
        count);
  }
  return status;
}
