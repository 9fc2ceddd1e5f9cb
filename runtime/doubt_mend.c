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
#include "runtime/doubt_volume.h"
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
  double place[3]; /* mean of the vertices', mm */
  double seen[3];  /* the same of the places among what was observed, mm */
  double weight;
  double scaled[3];      /* sum of deviation times gradient */
  double seen_scaled[3]; /* the same of the part of the error of which some was observed */
  double plain[3];       /* sum of gradients */
} cell;

/* How the error of every vertex covaries with the volume of one lung. */
typedef struct covariation {
  size_t lung, used;                                /* number of cells */
  double through[DOUBT_VECTORS];                    /* sum of gradients times each vector */
  double weights[3 * SUPINE_KRIGING_LANDMARKS_MAX]; /* of what the observed points predict of it */
  double terms[SUPINE_KRIGING_TERMS];
} covariation;

struct supine_doubt_mend {
  const supine_doubt *doubt;
  supine_doubt_shape shape;
  size_t lungs, vertices; /* lungs whose volumes are held: none if points decided their volume */
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
  return supine_space_doubles(bytes) + supine_doubt_shape_space(basis);
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

/* Return the factor of the error of which some was observed, before it was, mm. */
static double seen_deviation(const supine_doubt *d, const supine_doubt_features *f) {
  return d->seen == NULL ? 0
                         : f->seen_factor * supine_kriging_deviation(&d->seen->model, f->seen.size);
}

/* Add a vertex to its cell. */
static void add_vertex(const supine_doubt_mend *m, const float *box, const float *gradient,
                       const supine_doubt_features *f, covariation *c) {
  cell *own = &m->cells[cell_of(box, f->place)];
  const double g[3] = {(double)gradient[0], (double)gradient[1], (double)gradient[2]};
  const double weight = supine_length(g);
  const double seen = seen_deviation(m->doubt, f);
  own->weight += weight;
  for (size_t k = 0; k < 3; ++k) {
    own->scaled[k] += f->deviation * g[k];
    own->seen_scaled[k] += seen * g[k];
    own->plain[k] += g[k];
    own->place[k] += weight * f->place[k];
    own->seen[k] += weight * f->seen.position[k];
  }
  for (size_t v = 0; v < DOUBT_VECTORS; ++v) {
    c->through[v] += supine_dot(f->vector[v], g);
  }
}

/* Sum the gradients of a lung's vertices in cells, and times each vector of the features. The cells
 * that have any then come first. */
static void gather(const supine_doubt_mend *m, size_t state, covariation *c) {
  const supine_basis_info *info = supine_basis_get_info(m->doubt->basis);
  supine_doubt_walk walk = {m->doubt, state, .end = info->lung_begin[c->lung + 1]};
  memset(m->cells, 0, CELLS * sizeof *m->cells);
  memset(c->through, 0, sizeof c->through);
  for (size_t i = info->lung_begin[c->lung]; i < walk.end; ++i) {
    add_vertex(m, info->bounds + 6 * c->lung, m->gradient + 3 * i, supine_doubt_at(&walk, i), c);
  }
  c->used = 0;
  for (size_t i = 0; i < CELLS; ++i) {
    cell own = m->cells[i];
    if (own.weight > 0) {
      for (size_t k = 0; k < 3; ++k) {
        own.place[k] /= own.weight;
        own.seen[k] /= own.weight;
      }
      m->cells[c->used++] = own;
    }
  }
}

/* Compute the covariance of the part of the error of which some was observed with a lung's volume,
 * before it was, at a place where it has the variance 1 on each axis. */
static void covary_seen(const supine_doubt_mend *m, const covariation *c,
                        const supine_kriging_point *at, double sum[3]) {
  memset(sum, 0, 3 * sizeof *sum);
  for (size_t i = 0; i < c->used; ++i) {
    const cell *own = &m->cells[i];
    const double k = supine_doubt_kernel(at->position, at->lung, own->seen, c->lung);
    for (size_t axis = 0; axis < 3; ++axis) {
      sum[axis] += k * own->seen_scaled[axis];
    }
  }
}

/* Find what the observed points would predict of these covariances. Translation and rotation do not
 * change a volume, and a fitted volume is not held: terms add nothing. */
static void see(const supine_doubt_mend *m, covariation *c) {
  const supine_kriging *seen = m->doubt->seen;
  for (size_t j = 0; j < seen->count; ++j) {
    const supine_kriging_point *p = &seen->points[j];
    double sum[3];
    covary_seen(m, c, p, sum);
    for (size_t k = 0; k < 3; ++k) {
      c->weights[k * seen->count + j] = supine_kriging_deviation(&seen->model, p->size) * sum[k];
    }
  }
  supine_kriging_refit(seen, c->weights, c->terms);
}

/* Compute the covariance of the error of a vertex with a lung's volume. */
static void covary(const supine_doubt_mend *m, const covariation *c, const supine_doubt_features *f,
                   float *along) {
  const supine_doubt *d = m->doubt;
  const double common = supine_doubt_common_square(d);
  double sum[3] = {0};
  for (size_t i = 0; i < c->used; ++i) {
    const cell *own = &m->cells[i];
    const double k = supine_doubt_kernel(f->place, f->lung, own->place, c->lung);
    for (size_t axis = 0; axis < 3; ++axis) {
      sum[axis] += k * (f->deviation * own->scaled[axis] + common * own->plain[axis]);
    }
  }
  if (d->seen != NULL) {
    double before[3];
    double shift[3];
    covary_seen(m, c, &f->seen, before);
    supine_kriging_shift(d->seen, c->weights, c->terms, &f->seen, shift);
    for (size_t axis = 0; axis < 3; ++axis) {
      sum[axis] += seen_deviation(d, f) * before[axis] - f->seen_factor * shift[axis];
    }
  }
  for (size_t axis = 0; axis < 3; ++axis) {
    for (size_t v = 0; v < DOUBT_VECTORS; ++v) {
      sum[axis] += f->vector[v][axis] * c->through[v];
    }
    along[axis] = (float)sum[axis];
  }
}

/* Compute C g of one lung's volume, and its products with the gradients of all lungs. */
static void find_along(supine_doubt_mend *m, size_t state, size_t lung, double *products) {
  const supine_basis_info *info = supine_basis_get_info(m->doubt->basis);
  float *along = m->along + 3 * m->vertices * lung;
  covariation c = {.lung = lung};
  gather(m, state, &c);
  if (m->doubt->seen != NULL) {
    see(m, &c);
  }
  for (size_t other = 0; other < m->lungs; ++other) {
    supine_doubt_walk walk = {m->doubt, state, .end = info->lung_begin[other + 1]};
    products[other] = 0;
    for (size_t i = info->lung_begin[other]; i < walk.end; ++i) {
      covary(m, &c, supine_doubt_at(&walk, i), along + 3 * i);
      for (size_t k = 0; k < 3; ++k) {
        products[other] += (double)along[3 * i + k] * (double)m->gradient[3 * i + k];
      }
    }
  }
}

/* Compute the predicted positions, and the volumes that samples are to have: those of the state,
 * which the surface of located lungs has only nearly. */
static void predict(supine_doubt_mend *m, size_t state) {
  const supine_doubt *d = m->doubt;
  const supine_basis_info *info = supine_basis_get_info(d->basis);
  (void)supine_deform(d->basis, &d->model[state].pose[EXPECTED_AT], m->predicted);
  supine_doubt_shape_volumes(&m->shape, m->predicted, m->volume, NULL);
  if (d->location != NULL) {
    const double none[DOUBT_VECTORS] = {0};
    memset(m->predicted, 0, 3 * m->vertices * sizeof *m->predicted);
    for (size_t lung = 0; lung < info->lung_count; ++lung) {
      supine_doubt_add_positions(d, state, lung, none, m->predicted);
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
  supine_doubt_shape shape;
  const bool closed = supine_doubt_shape_prepare(doubt->basis,
                                                 space + supine_doubt_mend_space(doubt->basis) -
                                                     supine_doubt_shape_space(doubt->basis),
                                                 &shape);
  if (!info->has_volume || !closed) {
    return SUPINE_OK;
  }
  const bool held = doubt->location == NULL || !doubt->location->options.volume;
  *m = (supine_doubt_mend){
      .doubt = doubt, .shape = shape, .lungs = held ? info->lung_count : 0, .vertices = n};
  m->cells = (cell *)(m + 1);
  m->predicted = (float *)(m->cells + CELLS);
  m->gradient = m->predicted + 3 * n;
  m->along = m->gradient + 3 * n;
  predict(m, state);
  double volume[SUPINE_LUNGS_MAX];
  supine_doubt_shape_volumes(&m->shape, m->predicted, volume, m->gradient);
  for (size_t lung = 0; lung < m->lungs; ++lung) {
    find_along(m, state, lung, m->factor + m->lungs * lung);
  }
  for (size_t e = 0; e < m->lungs * m->lungs; ++e) { /* symmetric but for the cells */
    double *pair[2] = {&m->factor[e], &m->factor[e % m->lungs * m->lungs + e / m->lungs]};
    *pair[0] = *pair[1] = 0.5 * (*pair[0] + *pair[1]);
  }
  if (doubt->location != NULL) { /* from here on, in the frame of the observations */
    supine_location_move_all(doubt->location, n, m->predicted);
    supine_location_turn_all(doubt->location, n * m->lungs, m->along);
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
  supine_doubt_area(supine_basis_vertices(m->doubt->basis), triangle, reference);
  supine_doubt_area(m->predicted, triangle, before);
  supine_doubt_area(xyz, triangle, now);
  return !(supine_dot(before, now) > 0) ||
         (supine_dot(reference, before) > 0 && !(supine_dot(reference, now) > 0));
}

/* Give each triangle that is turned over the mean error of its vertices. Return whether one was. */
static bool repair(const supine_doubt_mend *m, float *xyz) {
  const supine_basis_info *info = supine_basis_get_info(m->doubt->basis);
  const uint32_t *triangle = supine_basis_triangles(m->doubt->basis);
  bool turned = supine_doubt_shape_unfold(&m->shape, m->predicted, xyz);
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
    supine_doubt_shape_volumes(&m->shape, xyz, away, NULL);
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
