/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Expandability from a property of a PLY file's vertices. */
#include <math.h>
#include <stdlib.h>

#include "precompute/lungs/expandability.h"

typedef struct placed {
  double x;
  size_t vertex;
} placed;

static int compare_placed(const void *a, const void *b) {
  const double x = ((const placed *)a)->x;
  const double y = ((const placed *)b)->x;
  return (x > y) - (x < y);
}

/* Gives `value` to the model's vertices within `reach` of p that have none yet. */
static void assign(const supine_lungs *lungs, const placed *order, const double p[3], double reach,
                   double value, double *a) {
  size_t low = 0;
  size_t high = lungs->mesh.vertex_count;
  while (low < high) {
    const size_t middle = low + (high - low) / 2;
    if (order[middle].x < p[0] - reach) {
      low = middle + 1;
    } else {
      high = middle;
    }
  }
  for (; low < lungs->mesh.vertex_count && order[low].x <= p[0] + reach; ++low) {
    const size_t i = order[low].vertex;
    const double *q = lungs->mesh.vertices + 3 * i;
    if (a[i] == 0.0 && fabs(q[1] - p[1]) <= reach && fabs(q[2] - p[2]) <= reach) {
      a[i] = value;
    }
  }
}

/* rows: x, y, z and expandability of the file's vertices. Ten parameters: the file's rows, and
 * the lungs' vertices in the order that finds them. */
static supine_status assign_all(const char *path, const char *property, const double *rows,
                                size_t count, const supine_lungs *lungs, const placed *order,
                                supine_axes axes, double unit, double *a, supine_error *error) {
  double reach = 0.0; /* positions went through single precision */
  for (size_t k = 0; k < 3; ++k) {
    reach = fmax(reach, 1e-6 * fmax(fabs(lungs->minimum[k]), fabs(lungs->maximum[k])));
  }
  for (size_t v = 0; v < count; ++v) {
    const double *row = rows + 4 * v;
    if (!(row[3] > 0.0) || !isfinite(row[3]) || !isfinite(1.0 / row[3])) {
      return supine_error_set(error, SUPINE_ERROR_FORMAT,
                              "%s: %.60s of vertex %zu is %g: expandability must be positive and "
                              "finite",
                              path, property, v, row[3]);
    }
    double p[3] = {row[0], row[1], row[2]};
    supine_mesh_axes_apply(axes, unit, p);
    assign(lungs, order, p, reach, row[3], a);
  }
  return SUPINE_OK;
}

supine_status supine_tissue_expandability_load_ply(const char *path, const char *property,
                                                   supine_axes axes, double millimetres_per_unit,
                                                   const supine_lungs *lungs, double *a,
                                                   supine_error *error) {
  const size_t n = lungs->mesh.vertex_count;
  const double unit = millimetres_per_unit > 0.0 ? millimetres_per_unit : 1.0;
  double *rows = NULL;
  size_t count = 0;
  supine_status status = supine_mesh_load_property(path, property, &rows, &count, error);
  if (status != SUPINE_OK) {
    return status;
  }
  placed *order = malloc(n * sizeof *order);
  if (order == NULL) {
    status = supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu vertices", n);
  } else {
    for (size_t i = 0; i < n; ++i) {
      order[i] = (placed){lungs->mesh.vertices[3 * i], i};
    }
    qsort(order, n, sizeof *order, compare_placed);
    status = assign_all(path, property, rows, count, lungs, order, axes, unit, a, error);
  }
  free(order);
  free(rows);
  return status;
}
