/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The best few modes of the normals. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <gsl/gsl_sort.h>

#include "precompute/normals/polynomial.h"
#include "precompute/normals/states.h"
#include "precompute/projection/compression.h"
#include "runtime/kernels/compact.h"
#include "runtime/kernels/tiles.h"
#include "sh/base/clones.h"
#include "sh/base/parallel.h"

/* Vertices of a lung, and states, that modes are found from and measured on: with twice as many the
 * errors change in the second digit. */
enum { ROWS = 4096, STATES = 192, HELD_OUT = 256, STEP = 3 };

/* Degrees: a fifth below 0.1 and 1, as postures and vertices other than the held-out ones err a
 * little differently. */
static const double mean_wanted = 0.08;
static const double p999_wanted = 0.8;
static const double degrees = 57.29577951308232;

/* One lung's modes before they are rounded; A, n and V as in normals.h. */
typedef struct fit {
  double *mix;     /* [MOST, 3, terms] T, by which n_jc = T_jc . A_c */
  double *weights; /* [MOST, 3, terms] V */
} fit;

/* gram [3, terms, terms] = A_c^T A_c of each component. */
static void find_gram(const supine_normals_rows *rows, size_t terms, double *gram) {
  memset(gram, 0, 3 * terms * terms * sizeof *gram);
  for (size_t r = 0; r < 3 * rows->count; ++r) {
    const double *row = rows->terms + r * terms;
    double *to = gram + r % 3 * terms * terms;
    for (size_t a = 0; a < terms; ++a) {
      for (size_t b = 0; b < terms; ++b) {
        to[a * terms + b] += row[a] * row[b];
      }
    }
  }
}

static double dot(const double *a, const double *b, size_t count) {
  double sum = 0.0;
  for (size_t i = 0; i < count; ++i) {
    sum += a[i] * b[i];
  }
  return sum;
}

/* The products P^T G P of states phi [S, 3, terms], each scaled to length 1 in G; `image`
 * [S, 3, terms] is G P. */
static void find_products(const double *gram, size_t terms, size_t s, const double *phi,
                          double *unit, double *image, double *product) {
  const size_t all = 3 * terms;
  for (size_t i = 0; i < s; ++i, phi += all) {
    for (size_t a = 0; a < all; ++a) {
      image[i * all + a] = dot(gram + a * terms, phi + a / terms * terms, terms);
    }
    const double square = dot(phi, image + i * all, all);
    const double length = square > 0.0 ? sqrt(square) : 1.0;
    for (size_t a = 0; a < all; ++a) {
      unit[i * all + a] = phi[a] / length;
      image[i * all + a] /= length;
    }
  }
  for (size_t i = 0; i < s; ++i) {
    for (size_t j = 0; j < s; ++j) {
      product[i * s + j] = dot(unit + i * all, image + j * all, all);
    }
  }
}

/* The SVD of the normals in states phi [S, 3, terms] by their products: modes orthonormal over the
 * rows. */
static supine_status find_fit(const supine_normals_rows *rows, size_t terms, size_t s,
                              const double *phi, size_t count, fit *made) {
  const size_t all = 3 * terms;
  supine_status status = SUPINE_ERROR_MEMORY;
  double *gram = malloc(all * terms * sizeof *gram);
  double *unit = malloc(s * all * sizeof *unit);
  double *image = malloc(s * all * sizeof *image);
  double *product = malloc(s * s * sizeof *product);
  double *vectors = malloc(count * s * sizeof *vectors);
  double values[STATES]; /* the routine wants room for all */
  if (gram == NULL || unit == NULL || image == NULL || product == NULL || vectors == NULL) {
    goto cleanup;
  }
  find_gram(rows, terms, gram);
  find_products(gram, terms, s, phi, unit, image, product);
  status = supine_projection_leading_eigenpairs(s, product, count, values, vectors);
  for (size_t j = 0; j < count && status == SUPINE_OK; ++j) {
    /* What rounding alone leaves is no mode. */
    const double length = values[j] > 1e-14 * values[0] ? 1.0 / sqrt(values[j]) : 0.0;
    for (size_t a = 0; a < all; ++a) {
      double mix = 0.0;
      double weight = 0.0;
      for (size_t i = 0; i < s; ++i) {
        mix += vectors[j * s + i] * unit[i * all + a];
        weight += vectors[j * s + i] * image[i * all + a];
      }
      made->mix[j * all + a] = length * mix;
      made->weights[j * all + a] = length * weight; /* T^T G */
    }
  }
cleanup:
  free(gram);
  free(unit);
  free(image);
  free(product);
  free(vectors);
  return status;
}

/* Angle between two vectors, degrees. */
static double angle_between(const double *a, const double *b) {
  const double x = a[1] * b[2] - a[2] * b[1];
  const double y = a[2] * b[0] - a[0] * b[2];
  const double z = a[0] * b[1] - a[1] * b[0];
  return degrees * atan2(sqrt(x * x + y * y + z * z), dot(a, b, 3));
}

/* A vertex's modes along one axis as an open basis has them: rounded to 13, 10 and 9 bits. */
static void pack(const int16_t *modes, size_t count, double *packed) {
  const size_t words = supine_tiles_normal_words(count);
  for (size_t j = 0; j < words; ++j) {
    double three[3] = {0.0, 0.0, 0.0};
    for (size_t k = j, which = 0; k < count; k += words, ++which) {
      three[which] = modes[k] / normal_unit();
    }
    const uint32_t word = normal_narrow(three[0], three[1], three[2]);
    for (size_t k = j, which = 0; k < count; k += words, ++which) {
      packed[k] = (double)normal_number(word, which) * normal_unit();
    }
  }
}

/* Exact normals of a row in every state by axis. States stand side by side in `across` [3, terms,
 * HELD_OUT], for vector units; each sum is in the order of dot. */
SUPINE_CLONES static void find_exact(const double *row, size_t terms, const double *across,
                                     double (*exact)[HELD_OUT]) {
  memset(exact, 0, 3 * sizeof *exact);
  for (size_t axis = 0; axis < 3; ++axis) {
    for (size_t a = 0; a < terms; ++a) {
      for (size_t i = 0; i < HELD_OUT; ++i) {
        exact[axis][i] += row[axis * terms + a] * across[(axis * terms + a) * HELD_OUT + i];
      }
    }
  }
}

/* Angles off of each row of a lung in each held-out state, added at `angles`; returns how many.
 * `made` holds what the file will; `across` [3, terms, HELD_OUT] is overwritten. */
static size_t measure(const supine_normals_rows *rows, size_t terms,
                      const supine_normals_states *states, size_t lung,
                      const supine_normals_modes *made, double *across, double *angles) {
  const size_t all = 3 * terms;
  const size_t count = made->count;
  const double *phi = states->phi + lung * states->room * all;
  const double *weights = made->weights + lung * count * all;
  size_t found = 0;
  double v[HELD_OUT][SUPINE_NORMALS_MOST];
  memset(across, 0, all * HELD_OUT * sizeof *across);
  for (size_t i = 0; i < states->count; ++i, phi += all) {
    for (size_t a = 0; a < all; ++a) {
      across[a * HELD_OUT + i] = phi[a];
    }
    for (size_t j = 0; j < count; ++j) {
      v[i][j] = dot(weights + j * all, phi, all);
    }
  }
  for (size_t r = 0; r < rows->count; ++r) {
    double packed[3][SUPINE_NORMALS_MOST];
    for (size_t axis = 0; axis < 3; ++axis) {
      pack(made->modes + (3 * (size_t)rows->vertex[r] + axis) * count, count, packed[axis]);
    }
    double exact[3][HELD_OUT];
    find_exact(rows->terms + 3 * r * terms, terms, across, exact);
    for (size_t i = 0; i < states->count; ++i) {
      double normal[3];
      for (size_t axis = 0; axis < 3; ++axis) {
        normal[axis] = dot(v[i], packed[axis], count);
      }
      angles[found++] = angle_between((double[]){exact[0][i], exact[1][i], exact[2][i]}, normal);
    }
  }
  return found;
}

/* Planes of modes for every vertex. One thread adds up all of a lung in a plane, so that sums do
 * not depend on threads. */
typedef struct planes_work {
  const supine_normals_surface *surface;
  const fit *fits; /* [G] */
  size_t terms;
  size_t first;  /* mode of the first plane */
  float *planes; /* [., N, 3] */
} planes_work;

static void planes_range(void *context, size_t begin, size_t end, size_t thread) {
  const planes_work *work = context;
  const supine_normals_surface *s = work->surface;
  (void)thread;
  for (size_t i = begin; i < end; ++i) {
    const size_t j = i / s->lung_count;
    const size_t lung = i % s->lung_count;
    supine_normals_mix(s, lung, work->fits[lung].mix + 3 * (work->first + j) * work->terms,
                       work->planes + 3 * s->vertex_count * j);
  }
}

/* Round planes to 16 bits, vertices scaled to a normal of length 1 at rest, into the modes from
 * work->first on; the unit of each mode goes to the weights. `rest` [N] lengths at rest. */
static void round_modes(const planes_work *work, const float *rest, supine_normals_modes *made) {
  const supine_normals_surface *s = work->surface;
  const size_t count = made->count;
  for (size_t lung = 0; lung < s->lung_count; ++lung) {
    for (size_t j = work->first; j < count; ++j) {
      const float *plane = work->planes + 3 * s->vertex_count * (j - work->first);
      float top = 0;
      for (size_t i = 3 * s->lung_begin[lung]; i < 3 * s->lung_begin[lung + 1]; ++i) {
        const float size = rest[i / 3] > 0 ? fabsf(plane[i]) / rest[i / 3] : 0;
        top = size > top ? size : top;
      }
      const double unit = top > 0 ? (double)top / INT16_MAX : 1.0;
      for (size_t i = 3 * s->lung_begin[lung]; i < 3 * s->lung_begin[lung + 1]; ++i) {
        const double value = rest[i / 3] > 0 ? (double)plane[i] / (double)rest[i / 3] : 0.0;
        made->modes[i * count + j] = (int16_t)lrint(value / unit);
      }
      for (size_t a = 0; a < 3 * work->terms; ++a) {
        made->weights[3 * (lung * count + j) * work->terms + a] *= unit;
      }
    }
  }
}

/* Lengths of the normals at rest, [N]. */
static supine_status find_rest(const supine_normals_surface *s, size_t terms, float *rest) {
  float *plane = calloc(3 * s->vertex_count + 1, sizeof *plane);
  double *one = calloc(3 * terms, sizeof *one);
  if (plane == NULL || one == NULL) {
    free(plane);
    free(one);
    return SUPINE_ERROR_MEMORY;
  }
  one[0] = one[terms] = one[2 * terms] = 1.0;
  for (size_t lung = 0; lung < s->lung_count; ++lung) {
    supine_normals_mix(s, lung, one, plane);
  }
  for (size_t i = 0; i < s->vertex_count; ++i) {
    const float *n = plane + 3 * i;
    rest[i] = sqrtf(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
  }
  free(plane);
  free(one);
  return SUPINE_OK;
}

/* Add modes up to `count` of them. */
static supine_status add_modes(planes_work *work, size_t count, const float *rest,
                               supine_normals_modes *made) {
  const supine_normals_surface *s = work->surface;
  const size_t all = 3 * work->terms;
  const size_t old = made->count;
  const size_t rows = 3 * s->vertex_count;
  int16_t *modes = realloc(made->modes, rows * count * sizeof *modes);
  made->modes = modes != NULL ? modes : made->modes;
  double *weights = realloc(made->weights, s->lung_count * count * all * sizeof *weights);
  made->weights = weights != NULL ? weights : made->weights;
  work->planes = calloc(rows * (count - old), sizeof *work->planes);
  if (modes == NULL || weights == NULL || work->planes == NULL) {
    free(work->planes);
    return SUPINE_ERROR_MEMORY;
  }
  for (size_t i = rows; i-- > 0;) { /* rows become longer, the last one first */
    memmove(modes + i * count, modes + i * old, old * sizeof *modes);
  }
  for (size_t lung = s->lung_count; lung-- > 0;) {
    double *to = weights + lung * count * all;
    memmove(to, weights + lung * old * all, old * all * sizeof *to);
    memcpy(to + old * all, work->fits[lung].weights + old * all, (count - old) * all * sizeof *to);
  }
  work->first = old;
  made->count = count;
  supine_parallel_for((count - old) * s->lung_count, 1, 0, planes_range, work);
  round_modes(work, rest, made);
  free(work->planes);
  return SUPINE_OK;
}

static size_t stride_of(const supine_normals_surface *s, size_t lung) {
  return 1 + (s->lung_begin[lung + 1] - s->lung_begin[lung]) / ROWS;
}

/* Errors on states and, where the lungs have more vertices than took part, vertices of their own.
 */
static supine_status measure_all(const supine_normals_surface *s,
                                 const supine_normals_states *states, supine_normals_modes *made) {
  const size_t terms = supine_normals_terms(s->mode_count);
  supine_status status = SUPINE_OK;
  const size_t most = s->lung_count * (2 * ROWS + 1) * (states->count + 1);
  double *angles = malloc((most + most / 1000 + 3) * sizeof *angles); /* and the largest of them */
  double *across = malloc(3 * terms * HELD_OUT * sizeof *across);
  size_t found = 0;
  if (angles == NULL || across == NULL) {
    free(angles);
    free(across);
    return SUPINE_ERROR_MEMORY;
  }
  for (size_t lung = 0; lung < s->lung_count && status == SUPINE_OK; ++lung) {
    supine_normals_rows rows;
    const size_t stride = stride_of(s, lung);
    status = supine_normals_rows_create(s, lung, stride / 2, stride, &rows);
    if (status == SUPINE_OK) {
      found += measure(&rows, terms, states, lung, made, across, angles + found);
      supine_normals_rows_free(&rows);
    }
  }
  if (status == SUPINE_OK && found > 0) {
    double sum = 0.0;
    for (size_t i = 0; i < found; ++i) {
      sum += angles[i];
    }
    const size_t above = found - (size_t)(0.999 * (double)(found - 1));
    gsl_sort_largest(angles + most, above, angles, 1, found);
    made->mean = sum / (double)found;
    made->p999 = angles[most + above - 1];
  }
  free(angles);
  free(across);
  return status;
}

/* Fits of every lung. */
static supine_status find_fits(const supine_normals_surface *s, const supine_normals_states *states,
                               size_t count, fit *fits) {
  const size_t terms = supine_normals_terms(s->mode_count);
  supine_status status = SUPINE_OK;
  for (size_t lung = 0; lung < s->lung_count && status == SUPINE_OK; ++lung) {
    supine_normals_rows rows = {0};
    fits[lung].mix = calloc(3 * count * terms, sizeof *fits[lung].mix);
    fits[lung].weights = calloc(3 * count * terms, sizeof *fits[lung].weights);
    status = fits[lung].mix == NULL || fits[lung].weights == NULL
                 ? SUPINE_ERROR_MEMORY
                 : supine_normals_rows_create(s, lung, 0, stride_of(s, lung), &rows);
    if (status == SUPINE_OK) {
      status = find_fit(&rows, terms, states->count, states->phi + 3 * lung * states->room * terms,
                        count, &fits[lung]);
    }
    supine_normals_rows_free(&rows);
  }
  return status;
}

supine_status supine_normals_modes_create(const supine_normals_surface *surface,
                                          supine_normals_modes *made, supine_error *error) {
  fit fits[SUPINE_LUNGS_MAX] = {{0}};
  supine_normals_states states = {0};
  supine_normals_states held_out = {0};
  float *rest = NULL;
  *made = (supine_normals_modes){0};
  if (surface->mode_count > SUPINE_NORMALS_FIELD_MAX || surface->triangle_count == 0) {
    return SUPINE_OK;
  }
  const size_t terms = supine_normals_terms(surface->mode_count);
  planes_work work = {.surface = surface, .fits = fits, .terms = terms};
  supine_status status = supine_normals_states_create(surface, STATES, 0.0, &states);
  if (status == SUPINE_OK) {
    status = supine_normals_states_create(surface, HELD_OUT, 0.37, &held_out);
  }
  if (status != SUPINE_OK || states.count == 0 || held_out.count == 0) {
    goto cleanup;
  }
  size_t most = SUPINE_NORMALS_MOST < states.count ? SUPINE_NORMALS_MOST : states.count;
  most = 3 * terms < most ? 3 * terms : most;
  rest = malloc(surface->vertex_count * sizeof *rest);
  status = rest == NULL ? SUPINE_ERROR_MEMORY : find_rest(surface, terms, rest);
  if (status == SUPINE_OK) {
    status = find_fits(surface, &states, most, fits);
  }
  for (size_t count = most < SUPINE_NORMALS_FEW ? most : SUPINE_NORMALS_FEW;
       status == SUPINE_OK && count <= most; count += STEP) {
    status = add_modes(&work, count, rest, made);
    if (status == SUPINE_OK) {
      status = measure_all(surface, &held_out, made);
    }
    if (made->mean <= mean_wanted && made->p999 <= p999_wanted) {
      break;
    }
  }
  memcpy(made->range, states.range, sizeof made->range);

cleanup:
  for (size_t lung = 0; lung < SUPINE_LUNGS_MAX; ++lung) {
    free(fits[lung].mix);
    free(fits[lung].weights);
  }
  supine_normals_states_free(&states);
  supine_normals_states_free(&held_out);
  free(rest);
  if (status != SUPINE_OK) {
    supine_normals_modes_free(made);
    return supine_error_set(error, status, "normals of %zu vertices: %s", surface->vertex_count,
                            supine_status_string(status));
  }
  return SUPINE_OK;
}

void supine_normals_modes_free(supine_normals_modes *modes) {
  free(modes->modes);
  free(modes->weights);
  *modes = (supine_normals_modes){0};
}
