/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Find a small number of modes that approximate all normals in all postures and volumes. */
#include <cblas.h>
#include <math.h>
#include <string.h>

#include "base/clones.h"
#include "base/lapack.h"
#include "base/parallel.h"
#include "precompute/normals/polynomial.h"
#include "precompute/projection/projection.h"
#include "precompute/projection/tally.h"
#include "runtime/kernels/compact.h"
#include "runtime/kernels/tiles.h"

enum {
  ROWS = 4096,    /* modes are found from at most this many vertices of a lung */
  STATES = 192,   /* modes are found from this many sampled states (posture and volume) */
  HELD_OUT = 256, /* errors are measured in this many held-out states (posture and volume) */
  STEP = 3        /* step between the numbers of modes that are tried */
};

/* A snapshot is all normals in one state. Up to MOST modes are weighted sums of up to SNAPSHOTS
 * snapshots. LANES states are evaluated together; the first of all is the reference surface. */
enum { LANES = 8, SNAPSHOTS = 6 * LANES - 1, MOST = SUPINE_NORMALS_MOST };

/* Largest accepted mean and 99.9th percentile of the angle between an exact normal and its
 * approximation, degrees. These limits are a fifth below the goals of 0.1 and 1 degree, because the
 * errors at vertices and in states that are not measured differ slightly. */
static const double mean_wanted = 0.08;
static const double p999_wanted = 0.8;
static const double degrees_per_radian = 57.29577951308232;

/* Snapshots (normals in one state) are added until they reproduce the normals of every state with
 * at most this squared error, relative to the sum of their squares. */
static const double least_unexplained = 1e-7;

/* Modes of the normals of one lung, before rounding. */
typedef struct fit {
  size_t count; /* number of modes, at most MOST */
  size_t snapshot_count;
  size_t state[SNAPSHOTS]; /* [snapshot_count] index of the sampled state of each snapshot */
  /* [1 + snapshot][mode] weight of a snapshot (normals in one state) in a mode; row 0 is zero */
  float snapshot_weights[1 + SNAPSHOTS][MOST];
  double *weights; /* [mode, 3, monomials] coefficients V (normal_modes.h) of each mode's weight */
  supine_normals_rows rows; /* polynomials that give the normals of held-out vertices */
} fit;

typedef struct normals_work {
  const supine_normals_surface *surface;
  size_t terms;
  supine_normals_fans fans;
  supine_normals_states states;
  supine_normals_states held_out;
  supine_arena memory; /* of the arrays of this struct and of `fits` */
  fit fits[SUPINE_LUNGS_MAX];
} normals_work;

/* Compute out[i, c, j] = sum over t of in[i, c, t] matrix[j, c, t] for in [count, 3, terms], matrix
 * [n, 3, terms] and out [count, 3, n]. */
static void apply_rows(const double *in, size_t count, size_t terms, const double *matrix, size_t n,
                       double *out) {
  for (size_t c = 0; c < 3; ++c) {
    cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasTrans, (int)count, (int)n, (int)terms, 1.0,
                in + c * terms, (int)(3 * terms), matrix + c * terms, (int)(3 * terms), 0.0,
                out + c * n, (int)(3 * n));
  }
}

/* Compute out_c = in_c A_c^T A_c for each axis c. Row r of A_c [rows->count, terms] holds the
 * polynomial coefficients along axis c of the normal of vertex r of `rows`. in_c and out_c are the
 * matrices [count, terms] of `in` and `out` for axis c. gram [terms, terms] is work space. */
static void apply_gram(const supine_normals_rows *rows, size_t terms, const double *in,
                       size_t count, double *gram, double *out) {
  const int width = (int)terms;
  for (size_t c = 0; c < 3; ++c) {
    const double *a = rows->terms + c * terms;
    cblas_dgemm(CblasRowMajor, CblasTrans, CblasNoTrans, width, width, (int)rows->count, 1.0, a,
                3 * width, a, 3 * width, 0.0, gram, width);
    cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasNoTrans, (int)count, width, width, 1.0,
                in + c * terms, 3 * width, gram, width, 0.0, out + c * terms, 3 * width);
  }
}

/* Choose snapshots (normals in one state) among s states by pivoted Cholesky factorisation. Find
 * the weighted sums of snapshots (modes) that approximate all states with the least squared error.
 * @param product       [s, s] scalar products of states' normals, 1 on the diagonal; overwritten
 * @param coefficients  [modes, snapshots] written: weight of each snapshot in each mode */
static supine_status choose_snapshots(size_t s, double *product, fit *made,
                                      double coefficients[MOST * SNAPSHOTS]) {
  lapack_int pivots[STATES];
  lapack_int rank = 0;
  double gram[SNAPSHOTS * SNAPSHOTS];
  double values[SNAPSHOTS];
  const lapack_int info = LAPACKE_dpstrf(LAPACK_COL_MAJOR, 'L', (lapack_int)s, product,
                                         (lapack_int)s, pivots, &rank, least_unexplained);
  if (info < 0) { /* a positive result means a singular matrix, which is no error */
    return supine_lapack_status(info);
  }
  const size_t r = rank < SNAPSHOTS ? (size_t)rank : SNAPSHOTS;
  made->snapshot_count = r;
  made->count = r < MOST ? r : MOST;
  for (size_t k = 0; k < r; ++k) {
    made->state[k] = (size_t)pivots[k] - 1;
    memset(product + k * s, 0, k * sizeof *product);
  }
  cblas_dsyrk(CblasColMajor, CblasLower, CblasTrans, (int)r, (int)s, 1.0, product, (int)s, 0.0,
              gram, (int)r);
  const supine_status status =
      supine_sh_leading_eigenpairs(r, gram, made->count, values, coefficients);
  cblas_dtrsm(CblasColMajor, CblasLeft, CblasLower, CblasTrans, CblasNonUnit, (int)r,
              (int)made->count, 1.0, product, (int)s, coefficients, (int)r);
  return status;
}

/* Find the modes that approximate the normals of the vertices of `rows` in all sampled states with
 * the least squared error. All states have equal weight. The modes are orthonormal over these
 * vertices. Write mix [MOST, 3, terms]: if A are the coefficients of the polynomial of any normal,
 * its mode j along axis c is sum over t of mix[j, c, t] A[c, t]. */
static supine_status find_fit(const normals_work *work, size_t lung,
                              const supine_normals_rows *rows, double *mix, fit *made) {
  const size_t terms = work->terms;
  const size_t all = 3 * terms;
  const size_t s = work->states.count;
  const double *phi = work->states.phi + lung * work->states.room * all;
  double coefficients[MOST * SNAPSHOTS];
  double length[STATES];
  SUPINE_ARENA arena = {0};
  double *gram = supine_arena_take(&arena, terms * terms, sizeof *gram);
  double *gram_phi = supine_arena_take(&arena, s * all, sizeof *gram_phi);
  double *product = supine_arena_take(&arena, s * s, sizeof *product);
  SUPINE_TRY(supine_arena_status(&arena));
  apply_gram(rows, terms, phi, s, gram, gram_phi);
  cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasTrans, (int)s, (int)s, (int)all, 1.0, phi, (int)all,
              gram_phi, (int)all, 0.0, product, (int)s);
  for (size_t i = 0; i < s; ++i) {
    length[i] = product[i * s + i] > 0.0 ? sqrt(product[i * s + i]) : 1.0;
  }
  for (size_t i = 0; i < s * s; ++i) {
    product[i] /= length[i / s] * length[i % s];
  }
  SUPINE_TRY(choose_snapshots(s, product, made, coefficients));
  memset(mix, 0, MOST * all * sizeof *mix);
  for (size_t j = 0; j < made->count; ++j) {
    for (size_t r = 0; r < made->snapshot_count; ++r) {
      const size_t state = made->state[r];
      const double share = coefficients[j * made->snapshot_count + r] / length[state];
      made->snapshot_weights[1 + r][j] = (float)share;
      cblas_daxpy((int)all, share, phi + state * all, 1, mix + j * all, 1);
    }
  }
  apply_gram(rows, terms, mix, MOST, gram, made->weights);
  return SUPINE_OK;
}

/* Find the modes of one lung, and the polynomials of its held-out vertices. */
static supine_status find_lung(normals_work *work, size_t lung, fit *made) {
  const supine_normals_surface *s = work->surface;
  const size_t stride = 1 + (s->lungs->lung_begin[lung + 1] - s->lungs->lung_begin[lung]) / ROWS;
  const size_t all = 3 * work->terms;
  SUPINE_ARENA rows_memory = {0};
  SUPINE_ARENA arena = {0};
  supine_normals_rows rows;
  double *mix = supine_arena_take(&arena, MOST * all, sizeof *mix);
  made->weights = supine_arena_take(&work->memory, MOST * all, sizeof *made->weights);
  SUPINE_TRY(supine_arena_status(&arena));
  SUPINE_TRY(supine_arena_status(&work->memory));
  SUPINE_TRY(supine_normals_rows_create(s, &work->fans, lung, 0, stride, &rows_memory, &rows));
  SUPINE_TRY(find_fit(work, lung, &rows, mix, made));
  supine_arena_free(&rows_memory);
  return supine_normals_rows_create(s, &work->fans, lung, stride / 2, stride, &work->memory,
                                    &made->rows);
}

/* Round the modes [count + 1] of one vertex along one axis as at run time, where three modes share
 * a 32-bit word with 13, 10 and 9 bits. */
static void pack(const int8_t *modes, size_t count, double *packed) {
  const size_t words = supine_tiles_normal_words(count);
  for (size_t j = 0; j < words; ++j) {
    double three[3] = {0.0, 0.0, 0.0};
    for (size_t k = j, which = 0; k < count; k += words, ++which) {
      three[which] = normal_from_bytes(modes, count, k) / normal_unit();
    }
    const uint32_t word = normal_narrow(three[0], three[1], three[2]);
    for (size_t k = j, which = 0; k < count; k += words, ++which) {
      packed[k] = (double)normal_number(word, which) * normal_unit();
    }
  }
}

/* Round the modes of n vertices to bytes (supine_basis_info.normals), in multiples of
 * unit[mode].
 * @param values   [n, 3, count] modes, first divided in place by `lengths`; x / 0 = 0
 * @param lengths  [n] length of each normal on the reference surface
 * @param bytes    [n, 3, count + 1] written: modes divided by `unit` */
static void round_modes(float *values, const float *lengths, size_t n, size_t count, int8_t *bytes,
                        double *unit) {
  float top[MOST] = {0.0f};
  for (size_t i = 0; i < 3 * n; ++i) {
    const float factor = lengths[i / 3] > 0.0f ? 1.0f / lengths[i / 3] : 0.0f;
    for (size_t j = 0; j < count; ++j) {
      const float size = fabsf(values[i * count + j] *= factor);
      top[j] = size > top[j] ? size : top[j];
    }
  }
  for (size_t j = 0; j < count; ++j) {
    unit[j] = top[j] > 0 ? (double)top[j] / (256 * INT8_MAX) : 1.0;
    top[j] = (float)(1.0 / unit[j]);
  }
  for (size_t i = 0; i < 3 * n; ++i) {
    const float *from = values + i * count;
    int8_t *row = bytes + i * (count + 1);
    for (size_t j = 0; j < count; ++j) {
      row[j] = (int8_t)lrintf(from[j] * top[j] / 256);
    }
    row[count] = (int8_t)lrintf(fminf(from[0] * top[0] - 256.0f * row[0], INT8_MAX));
  }
}

/* Find the angles [count], degrees, between the columns of a [3, count] and those of b. */
SUPINE_CLONES static void find_angles(size_t count, const double *a, const double *b,
                                      double *angles) {
  double cosine[HELD_OUT];
  for (size_t i = 0; i < count; ++i) {
    const size_t y = count + i;
    const size_t z = 2 * count + i;
    const double cross[3] = {a[y] * b[z] - a[z] * b[y], a[z] * b[i] - a[i] * b[z],
                             a[i] * b[y] - a[y] * b[i]};
    cosine[i] = a[i] * b[i] + a[y] * b[y] + a[z] * b[z];
    angles[i] = sqrt(cross[0] * cross[0] + cross[1] * cross[1] + cross[2] * cross[2]);
  }
  for (size_t i = 0; i < count; ++i) {
    angles[i] = degrees_per_radian * atan2(angles[i], cosine[i]);
  }
}

/* Measure the angles between exact and approximate normals at the held-out vertices of a lung, in
 * all held-out states. Add them to the histogram `tally`, and their sum to `sum`. */
static void measure(const normals_work *work, size_t lung, const supine_normals_modes *found,
                    supine_tally *tally, double *sum) {
  enum { BLOCK = 16 }; /* vertices whose exact normals are computed at a time */
  const fit *made = &work->fits[lung];
  const size_t all = 3 * work->terms;
  const size_t states = work->held_out.count;
  const size_t count = found->count;
  const double *weights = found->weights + lung * count * all;
  const double *phi = work->held_out.phi + lung * work->held_out.room * all;
  double v[HELD_OUT * MOST];
  double exact[BLOCK * 3 * HELD_OUT]; /* [BLOCK, 3, states] exact normals */
  double normals[3 * HELD_OUT];
  double angles[HELD_OUT];
  cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasTrans, (int)states, (int)count, (int)all, 1.0, phi,
              (int)all, weights, (int)all, 0.0, v, (int)count);
  for (size_t r = 0; r < made->rows.count; ++r) {
    double packed[3][MOST];
    if (r % BLOCK == 0) {
      const size_t rows = made->rows.count - r < BLOCK ? made->rows.count - r : BLOCK;
      apply_rows(made->rows.terms + r * all, rows, work->terms, phi, states, exact);
    }
    for (size_t axis = 0; axis < 3; ++axis) {
      pack(found->modes + (3 * made->rows.vertex[r] + axis) * (count + 1), count, packed[axis]);
    }
    cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasTrans, 3, (int)states, (int)count, 1.0, packed[0],
                MOST, v, (int)count, 0.0, normals, (int)states);
    find_angles(states, exact + r % BLOCK * 3 * states, normals, angles);
    for (size_t i = 0; i < states; ++i) {
      *sum += angles[i];
    }
    supine_projection_tally_add(tally, states, angles);
  }
}

/* Measure the angular error of modes, and set made->mean and made->p999. */
static supine_status measure_all(const normals_work *work, supine_normals_modes *made) {
  SUPINE_ARENA arena = {0};
  supine_tally *tally = supine_arena_zeros(&arena, 1, sizeof *tally);
  double sum = 0.0;
  SUPINE_TRY(supine_arena_status(&arena));
  for (size_t lung = 0; lung < work->surface->lungs->lung_count; ++lung) {
    measure(work, lung, made, tally, &sum);
  }
  made->mean = tally->count > 0 ? sum / (double)tally->count : 0.0;
  made->p999 = supine_projection_tally_percentile(tally, 0.999);
  return SUPINE_OK;
}

/* Work space of make_modes(), which computes each vertex's modes as sums over the snapshots. */
typedef struct planes_work {
  const normals_work *work;
  size_t count; /* number of modes */
  size_t first; /* index of the first evaluated state: 0 is the reference surface, 1 + r is
                   snapshot r */
  /* [lung][axis][displacement mode][lane] gain (factor) along the axis times weight of the mode. */
  float (*mode_factors)[3][SUPINE_NORMALS_FIELD_MAX][LANES];
  float *positions; /* [N, 3, LANES] positions in each of LANES states, mm */
  float *modes;     /* [N, 3, count] modes summed over the snapshots evaluated so far */
  float *lengths;   /* [N] length of each normal on the reference surface */
} planes_work;

static size_t lung_of(const supine_normals_surface *s, size_t vertex) {
  return s->lungs->lung_count == 2 && vertex >= s->lungs->lung_begin[1];
}

SUPINE_CLONES static void place_range(void *context, size_t begin, size_t end, size_t thread) {
  const planes_work *planes = context;
  const supine_normals_surface *s = planes->work->surface;
  const bool vector = s->kind == SUPINE_ROWS_VECTOR;
  (void)thread;
  for (size_t row = begin; row < end; ++row) {
    const float *c = s->field->coefficients + (vector ? row : row / 3) * s->field->mode_count;
    const float d = vector ? 1.0f : s->directions[row];
    const float(*mode_factors)[LANES] =
        (const float(*)[LANES])planes->mode_factors[lung_of(s, row / 3)][row % 3];
    float sum[LANES] = {0.0f};
    for (size_t k = 0; k < s->field->mode_count; ++k) {
#pragma GCC unroll 1 /* full unrolling would prevent vectorisation */
      for (size_t l = 0; l < LANES; ++l) {
        sum[l] += c[k] * mode_factors[k][l];
      }
    }
    for (size_t l = 0; l < LANES; ++l) {
      planes->positions[row * LANES + l] = s->vertices[row] + d * sum[l];
    }
  }
}

SUPINE_CLONES static void sum_range(void *context, size_t begin, size_t end, size_t thread) {
  const planes_work *planes = context;
  const supine_normals_surface *s = planes->work->surface;
  const supine_normals_fans *fans = &planes->work->fans;
  (void)thread;
  for (size_t i = begin; i < end; ++i) {
    const float *p = planes->positions + 3 * i * LANES;
    float normal[3][LANES] = {{0.0f}};
    for (size_t at = fans->begin[i]; at < fans->begin[i + 1]; ++at) {
      uint32_t others[2];
      supine_normals_fan_others(s->lungs->mesh.triangles, fans->corner[at], others);
      const float *a = planes->positions + 3 * (size_t)others[0] * LANES;
      const float *b = planes->positions + 3 * (size_t)others[1] * LANES;
      for (size_t axis = 0; axis < 3; ++axis) {
        const size_t y = (axis + 1) % 3 * LANES;
        const size_t z = (axis + 2) % 3 * LANES;
        for (size_t l = 0; l < LANES; ++l) {
          normal[axis][l] += (a[y + l] - p[y + l]) * (b[z + l] - p[z + l]) -
                             (b[y + l] - p[y + l]) * (a[z + l] - p[z + l]);
        }
      }
    }
    const float(*share)[MOST] =
        (const float(*)[MOST])(planes->work->fits[lung_of(s, i)].snapshot_weights + planes->first);
    if (planes->first == 0) {
      planes->lengths[i] = sqrtf(normal[0][0] * normal[0][0] + normal[1][0] * normal[1][0] +
                                 normal[2][0] * normal[2][0]);
    }
    for (size_t axis = 0; axis < 3; ++axis) {
      float sum[MOST] = {0.0f};
      for (size_t l = 0; l < LANES; ++l) {
        for (size_t j = 0; j < MOST; ++j) {
          sum[j] += normal[axis][l] * share[l][j];
        }
      }
      float *modes = planes->modes + (3 * i + axis) * planes->count;
      for (size_t j = 0; j < planes->count; ++j) {
        modes[j] += sum[j];
      }
    }
  }
}

/* Copy planes->mode_factors, the gain of an axis times the weight of a mode, from the monomials of
 * the sampled states. The monomials along axis c are 1, the products for the gain of axis c + 1,
 * and others. Those for `axis` are therefore found at c = (axis + 2) % 3. */
static void find_mode_factors(const planes_work *planes) {
  const normals_work *work = planes->work;
  for (size_t lung = 0; lung < work->surface->lungs->lung_count; ++lung) {
    for (size_t axis = 0; axis < 3; ++axis) {
      for (size_t l = 0; l < LANES; ++l) {
        const size_t lane = planes->first + l;
        const size_t state = lane > 0 ? work->fits[lung].state[lane - 1] : 0;
        const double *phi = work->states.phi +
                            ((lung * work->states.room + state) * 3 + (axis + 2) % 3) * work->terms;
        for (size_t k = 0; k < work->surface->field->mode_count; ++k) {
          planes->mode_factors[lung][axis][k][l] = lane > 0 ? (float)phi[1 + k] : 0.0f;
        }
      }
    }
  }
}

/* Compute `count` modes of all vertices, and measure their error. */
static supine_status make_modes(const normals_work *work, size_t count, supine_arena *arena,
                                supine_normals_modes *made) {
  enum { GRAIN = 1024 };
  const supine_normals_surface *s = work->surface;
  const size_t n = s->lungs->mesh.vertex_count;
  const size_t all = 3 * work->terms;
  float mode_factors[SUPINE_LUNGS_MAX][3][SUPINE_NORMALS_FIELD_MAX][LANES];
  SUPINE_ARENA own = {0};
  planes_work planes = {.work = work,
                        .count = count,
                        .mode_factors = mode_factors,
                        .positions = supine_arena_take(&own, 3 * n * LANES, sizeof(float)),
                        .modes = supine_arena_zeros(&own, 3 * n * count, sizeof(float)),
                        .lengths = supine_arena_take(&own, n, sizeof(float))};
  made->modes = supine_arena_take(arena, 3 * n * (count + 1), sizeof *made->modes);
  made->weights =
      supine_arena_take(arena, s->lungs->lung_count * count * all, sizeof *made->weights);
  made->count = count;
  SUPINE_TRY(supine_arena_status(&own));
  SUPINE_TRY(supine_arena_status(arena));
  size_t snapshots = 0;
  for (size_t lung = 0; lung < s->lungs->lung_count; ++lung) {
    snapshots =
        work->fits[lung].snapshot_count > snapshots ? work->fits[lung].snapshot_count : snapshots;
  }
  for (; planes.first <= snapshots; planes.first += LANES) {
    find_mode_factors(&planes);
    supine_parallel_for(3 * n, 3 * GRAIN, 0, place_range, &planes);
    supine_parallel_for(n, GRAIN, 0, sum_range, &planes);
  }
  for (size_t lung = 0; lung < s->lungs->lung_count; ++lung) {
    const size_t begin = s->lungs->lung_begin[lung];
    double unit[MOST];
    round_modes(planes.modes + 3 * begin * count, planes.lengths + begin,
                s->lungs->lung_begin[lung + 1] - begin, count,
                made->modes + 3 * begin * (count + 1), unit);
    for (size_t i = 0; i < count * all; ++i) { /* the modes are stored as multiples of `unit` */
      made->weights[lung * count * all + i] = work->fits[lung].weights[i] * unit[i / all];
    }
  }
  return measure_all(work, made);
}

static supine_status find_modes(normals_work *work, supine_arena *arena,
                                supine_normals_modes *made) {
  const supine_normals_surface *s = work->surface;
  size_t most = MOST;
  SUPINE_TRY(supine_normals_states_create(s, STATES, 0.0, &work->memory, &work->states));
  SUPINE_TRY(supine_normals_states_create(s, HELD_OUT, 0.37, &work->memory, &work->held_out));
  if (work->states.count == 0 || work->held_out.count == 0) {
    return SUPINE_OK;
  }
  SUPINE_TRY(supine_normals_fans_create(s, &work->memory, &work->fans));
  for (size_t lung = 0; lung < s->lungs->lung_count; ++lung) {
    SUPINE_TRY(find_lung(work, lung, &work->fits[lung]));
    most = work->fits[lung].count < most ? work->fits[lung].count : most;
  }
  size_t count = most < SUPINE_NORMALS_FEW ? most : SUPINE_NORMALS_FEW;
  SUPINE_TRY(make_modes(work, count, arena, made));
  while ((made->mean > mean_wanted || made->p999 > p999_wanted) && count + STEP <= most) {
    count += STEP;
    SUPINE_TRY(make_modes(work, count, arena, made));
  }
  memcpy(made->range, work->states.range, sizeof made->range);
  return SUPINE_OK;
}

supine_status supine_normals_modes_create(const supine_normals_surface *surface,
                                          supine_arena *arena, supine_normals_modes *made,
                                          supine_error *error) {
  *made = (supine_normals_modes){0};
  if (surface->field->mode_count > SUPINE_NORMALS_FIELD_MAX ||
      surface->lungs->mesh.triangle_count == 0) {
    return SUPINE_OK;
  }
  SUPINE_ARENA own = {0};
  normals_work *work = supine_arena_zeros(&own, 1, sizeof *work);
  SUPINE_TRY(supine_arena_check(&own, error, "normals"));
  work->surface = surface;
  work->terms = supine_normals_terms(surface->field->mode_count);
  const supine_status status = find_modes(work, arena, made);
  supine_arena_free(&work->memory);
  return status == SUPINE_OK
             ? status
             : supine_error_set(error, status, "normals of %zu vertices: %s",
                                surface->lungs->mesh.vertex_count, supine_status_string(status));
}
