/* SPDX-License-Identifier: MIT */
/* Mend random lungs: give each lung the volume that was predicted, and take back what folds.
 *
 * Of a random error e with the covariance C, the one that keeps the volumes V is, to first order,
 *
 *     e - C g (g' C g)^-1 g' e        g: change of each volume with each vertex, mm^2
 *
 * which is kriging with the volumes as observations (Matheron's rule). C g is computed once for a
 * state; the volumes are then made exact by Newton's method along it. */
#include <math.h>
#include <string.h>

#include "base/vec3.h"
#include "runtime/doubt.h"
#include "runtime/internal.h"

enum {
  ACROSS = 9,                       /* cells along each axis of a lung's box */
  CELLS = ACROSS * ACROSS * ACROSS, /* cells of a lung */
  VOLUME_STEPS = 20,                /* most steps of Newton's method */
  FOLD_STEPS = 200                  /* most repairs of folded triangles */
};

static const double exact = 10; /* mm^3: difference of a volume at which Newton's method ends */

/* The gradients of a lung's volume, summed over the vertices in a cell of the lung's box. */
typedef struct cell {
  supine_doubt_features features; /* its place is the mean of the vertices', its deviation is 1 */
  double weight;
  double scaled[3]; /* sum of deviation times gradient */
  double plain[3];  /* sum of gradients */
} cell;

struct supine_doubt_mend {
  const supine_doubt *doubt;
  size_t lungs, vertices;
  double volume[SUPINE_LUNGS_MAX];                    /* predicted, mm^3 */
  double factor[SUPINE_LUNGS_MAX * SUPINE_LUNGS_MAX]; /* Cholesky factor of g' C g */
  cell *cells;                                        /* [CELLS] of the lung at hand */
  float *predicted;                                   /* [vertices, 3] mm */
  float *gradient;                                    /* [vertices, 3] g, mm^2 */
  float *along;                                       /* [lungs, vertices, 3] C g, mm^4 */
};

size_t supine_doubt_mend_space(const supine_basis *basis) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  const size_t floats = 3 * info->vertex_count * (2 + info->lung_count);
  const size_t bytes = sizeof(supine_doubt_mend) + CELLS * sizeof(cell) + floats * sizeof(float);
  return (bytes + sizeof(double) - 1) / sizeof(double);
}

/* Return the lung of a triangle. */
static size_t lung_of(const supine_basis_info *info, const uint32_t *triangle) {
  size_t lung = 0;
  while (triangle[0] >= info->lung_begin[lung + 1]) {
    ++lung;
  }
  return lung;
}

/* Compute the vector area of a triangle, times 2. */
static void find_area(const float *xyz, const uint32_t *triangle, double area[3]) {
  double side[2][3];
  for (size_t k = 0; k < 6; ++k) {
    side[k / 3][k % 3] =
        (double)xyz[3 * triangle[1 + k / 3] + k % 3] - (double)xyz[3 * triangle[0] + k % 3];
  }
  supine_cross(side[0], side[1], area);
}

/* Compute the volume of each lung, mm^3. */
static void find_volumes(const supine_basis *basis, const float *xyz, double *volume) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  const uint32_t *triangle = supine_basis_triangles(basis);
  memset(volume, 0, info->lung_count * sizeof *volume);
  for (size_t t = 0; t < info->triangle_count; ++t, triangle += 3) {
    const float *corner = xyz + 3 * (size_t)triangle[0];
    double area[3];
    find_area(xyz, triangle, area);
    const size_t lung = lung_of(info, triangle);
    for (size_t k = 0; k < 3; ++k) { /* relative to the first vertex of the lung, for precision */
      const double from = (double)xyz[3 * info->lung_begin[lung] + k];
      volume[lung] += area[k] * ((double)corner[k] - from) / 6;
    }
  }
}

/* Compute the change of a lung's volume with each of its vertices. */
static void find_gradient(const supine_basis *basis, const float *xyz, float *gradient) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  const uint32_t *triangle = supine_basis_triangles(basis);
  memset(gradient, 0, 3 * info->vertex_count * sizeof *gradient);
  for (size_t t = 0; t < info->triangle_count; ++t, triangle += 3) {
    double area[3];
    find_area(xyz, triangle, area);
    for (size_t e = 0; e < 9; ++e) {
      gradient[3 * (size_t)triangle[e / 3] + e % 3] += (float)(area[e % 3] / 6);
    }
  }
}

/* Return the index of the cell of a vertex in the box of its lung. */
static size_t cell_of(const float *box, const double place[3]) {
  size_t at = 0;
  for (size_t k = 0; k < 3; ++k) {
    const double width = (double)box[3 + k] - (double)box[k];
    const double share = width > 0 ? (place[k] - (double)box[k]) / width : 0;
    at = at * ACROSS + (size_t)(fmin(fmax(share, 0), 0.999) * ACROSS);
  }
  return at;
}

/* Sum the gradients of a lung's vertices in cells, and times each vector of the features.
 * @return the number of cells that have any, which then come first */
static size_t gather(const supine_doubt_mend *m, size_t state, size_t lung,
                     double through[DOUBT_VECTORS]) {
  const supine_basis_info *info = supine_basis_get_info(m->doubt->basis);
  supine_doubt_features features[LOCATE_BLOCK];
  const size_t end = info->lung_begin[lung + 1];
  size_t used = 0;
  memset(m->cells, 0, CELLS * sizeof *m->cells);
  memset(through, 0, DOUBT_VECTORS * sizeof *through);
  for (size_t at = info->lung_begin[lung]; at < end; at += LOCATE_BLOCK) {
    const size_t last = end - at < LOCATE_BLOCK ? end : at + LOCATE_BLOCK;
    supine_doubt_evaluate(m->doubt, state, at, last, features);
    for (size_t i = 0; i < last - at; ++i) {
      const supine_doubt_features *f = &features[i];
      cell *c = &m->cells[cell_of(info->bounds + 6 * lung, f->place)];
      double g[3];
      for (size_t k = 0; k < 3; ++k) {
        g[k] = (double)m->gradient[3 * (at + i) + k];
        c->scaled[k] += f->deviation * g[k];
        c->plain[k] += g[k];
      }
      const double weight = supine_length(g);
      c->weight += weight;
      for (size_t k = 0; k < 3; ++k) {
        c->features.place[k] += weight * f->place[k];
      }
      for (size_t v = 0; v < DOUBT_VECTORS; ++v) {
        through[v] += supine_dot(f->vector[v], g);
      }
    }
  }
  for (size_t i = 0; i < CELLS; ++i) {
    cell c = m->cells[i];
    if (c.weight > 0) {
      for (size_t k = 0; k < 3; ++k) {
        c.features.place[k] /= c.weight;
      }
      c.features.lung = lung;
      m->cells[used++] = c;
    }
  }
  return used;
}

/* Compute the covariance of the error of a vertex with a lung's volume. */
static void covary(const supine_doubt_mend *m, size_t used, const double *through,
                   const supine_doubt_features *f, float *along) {
  const double day = supine_doubt_day_square(m->doubt);
  double sum[3] = {0};
  for (size_t i = 0; i < used; ++i) {
    const cell *c = &m->cells[i];
    const double k = supine_doubt_kernel(f, &c->features);
    for (size_t axis = 0; axis < 3; ++axis) {
      sum[axis] += k * (f->deviation * c->scaled[axis] + day * c->plain[axis]);
    }
  }
  for (size_t axis = 0; axis < 3; ++axis) {
    for (size_t v = 0; v < DOUBT_VECTORS; ++v) {
      sum[axis] += f->vector[v][axis] * through[v];
    }
    along[axis] = (float)sum[axis];
  }
}

/* Compute C g of one lung's volume, and its products with the gradients of all lungs. */
static void find_along(supine_doubt_mend *m, size_t state, size_t lung, double *products) {
  const supine_basis_info *info = supine_basis_get_info(m->doubt->basis);
  float *along = m->along + 3 * m->vertices * lung;
  supine_doubt_features features[LOCATE_BLOCK];
  double through[DOUBT_VECTORS];
  const size_t used = gather(m, state, lung, through);
  for (size_t other = 0; other < m->lungs; ++other) {
    const size_t end = info->lung_begin[other + 1];
    products[other] = 0;
    for (size_t at = info->lung_begin[other]; at < end; at += LOCATE_BLOCK) {
      const size_t last = end - at < LOCATE_BLOCK ? end : at + LOCATE_BLOCK;
      supine_doubt_evaluate(m->doubt, state, at, last, features);
      for (size_t i = at; i < last; ++i) {
        covary(m, used, through, &features[i - at], along + 3 * i);
        for (size_t k = 0; k < 3; ++k) {
          products[other] += (double)along[3 * i + k] * (double)m->gradient[3 * i + k];
        }
      }
    }
  }
}

supine_status supine_doubt_mend_prepare(const supine_doubt *doubt, size_t state, double *space,
                                        const supine_doubt_mend **mend, supine_error *error) {
  const supine_basis_info *info = supine_basis_get_info(doubt->basis);
  supine_doubt_mend *m = (supine_doubt_mend *)space;
  const size_t n = info->vertex_count;
  *mend = NULL;
  if (state >= doubt->state_count) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT, "state %zu: give one below %zu", state,
                            doubt->state_count);
  }
  if (!info->has_volume || supine_basis_metadata(doubt->basis, "content") != NULL) {
    return SUPINE_OK;
  }
  *m = (supine_doubt_mend){.doubt = doubt, .lungs = info->lung_count, .vertices = n};
  m->cells = (cell *)(m + 1);
  m->predicted = (float *)(m->cells + CELLS);
  m->gradient = m->predicted + 3 * n;
  m->along = m->gradient + 3 * n;
  (void)supine_deform(doubt->basis, &doubt->model[state].pose[EXPECTED_AT], m->predicted);
  find_volumes(doubt->basis, m->predicted, m->volume);
  find_gradient(doubt->basis, m->predicted, m->gradient);
  for (size_t lung = 0; lung < m->lungs; ++lung) {
    find_along(m, state, lung, m->factor + m->lungs * lung);
  }
  for (size_t e = 0; e < m->lungs * m->lungs; ++e) { /* symmetric but for the cells */
    double *pair[2] = {&m->factor[e], &m->factor[e % m->lungs * m->lungs + e / m->lungs]};
    *pair[0] = *pair[1] = 0.5 * (*pair[0] + *pair[1]);
  }
  if (supine_kriging_factor(m->lungs, m->factor)) {
    *mend = m;
  }
  return SUPINE_OK;
}

/* Return whether a triangle is turned over, although the prediction does not turn it: against the
 * prediction, or against the reference surface, as folds are counted elsewhere. */
static bool is_turned(const supine_doubt_mend *m, const float *xyz, const uint32_t *triangle) {
  double reference[3];
  double before[3];
  double now[3];
  find_area(supine_basis_vertices(m->doubt->basis), triangle, reference);
  find_area(m->predicted, triangle, before);
  find_area(xyz, triangle, now);
  return !(supine_dot(before, now) > 0) ||
         (supine_dot(reference, before) > 0 && !(supine_dot(reference, now) > 0));
}

/* Give each triangle that is turned over the mean error of its vertices. Return whether one was. */
static bool repair(const supine_doubt_mend *m, float *xyz) {
  const supine_basis_info *info = supine_basis_get_info(m->doubt->basis);
  const uint32_t *triangle = supine_basis_triangles(m->doubt->basis);
  bool turned = false;
  for (size_t t = 0; t < info->triangle_count; ++t, triangle += 3) {
    if (!is_turned(m, xyz, triangle)) {
      continue;
    }
    turned = true;
    for (size_t k = 0; k < 3; ++k) {
      float mean = 0;
      for (size_t v = 0; v < 3; ++v) {
        const size_t at = 3 * (size_t)triangle[v] + k;
        mean += (xyz[at] - m->predicted[at]) / 3;
      }
      for (size_t v = 0; v < 3; ++v) {
        const size_t at = 3 * (size_t)triangle[v] + k;
        xyz[at] = m->predicted[at] + mean;
      }
    }
  }
  return turned;
}

/* Move the vertices along C g so that each lung has its predicted volume. */
static bool hold_volumes(const supine_doubt_mend *m, float *xyz) {
  for (int step = 0; step < VOLUME_STEPS; ++step) {
    double away[SUPINE_LUNGS_MAX];
    double most = 0;
    find_volumes(m->doubt->basis, xyz, away);
    for (size_t lung = 0; lung < m->lungs; ++lung) {
      away[lung] -= m->volume[lung];
      most = fmax(most, fabs(away[lung]));
    }
    if (most <= exact) {
      return true;
    }
    supine_kriging_forward(m->lungs, m->factor, away);
    supine_kriging_backward(m->lungs, m->factor, away);
    for (size_t e = 0; e < 3 * m->vertices * m->lungs; ++e) {
      xyz[e % (3 * m->vertices)] -= (float)(away[e / (3 * m->vertices)] * (double)m->along[e]);
    }
  }
  return false;
}

supine_status supine_doubt_mend_sample(const supine_doubt_mend *mend, float *xyz,
                                       supine_error *error) {
  if (mend == NULL) {
    return SUPINE_OK;
  }
  bool held = hold_volumes(mend, xyz);
  for (int step = 0; step < FOLD_STEPS; ++step) {
    if (!held || !repair(mend, xyz)) {
      break;
    }
    held = hold_volumes(mend, xyz);
  }
  return held ? SUPINE_OK
              : supine_error_set(error, SUPINE_ERROR_NUMERICAL,
                                 "a random error cannot be made to keep the volumes: it is too "
                                 "large for these lungs; choose a volume nearer to the scan's");
}
