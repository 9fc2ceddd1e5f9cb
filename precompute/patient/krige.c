/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Fit a law together with the kriging of its residual. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <cblas.h>
#include <lapacke.h>

#include "precompute/patient/krige.h"

#include "runtime/kriging.h"
#include "sh/base/vec3.h"

enum {
  TERMS = SUPINE_PATIENT_TERMS,
  LAW = SUPINE_PATIENT_CONSTANTS, /* the first columns; the motion follows */
  SCALE = TERMS - 1,
  WIDTH = TERMS + 1, /* of the design: the terms, then the residual */
  STEPS = 60
};

static const double scale_spread = 0.3;  /* prior deviation of the size of a known shape */
static const double settled = 1e-10;     /* relative decrease of the squares that ends the fit */
static const double damping_most = 1e10; /* damping at which no step decreases the squares */

struct supine_patient_krige {
  const supine_patient_row *rows;
  size_t count;
  supine_patient_krige_options options; /* with the sill and noise in use */
  supine_patient_power law;
  supine_patient_centre *centre; /* [count] of each row, with weight 0 */
  double *factor;                /* [count, count] Cholesky factor of the covariance, if g */
  double *design;                /* [count, WIDTH] whitened */
  double *weight;                /* [count] */
  double normal[TERMS * TERMS];  /* normal matrix of the terms, Cholesky-factored */
  double right[TERMS];
  double squares; /* squared whitened residual, with the prior's */
  double sill;    /* factor on the covariance of g, for a law of size 1 */
};

supine_patient_krige_options supine_patient_krige_prior(supine_patient_law law,
                                                        const supine_patient_power *mean,
                                                        supine_patient_moved moved) {
  static const double spread[SUPINE_PATIENT_LAW_COUNT][3] = {{0.3, 0.3, 0.3}, {3.0, 1.0, 1.0}};
  supine_patient_krige_options options = {.mean = *mean,
                                          .shape_kept = law == SUPINE_PATIENT_DEEP,
                                          .moved = moved,
                                          .sill = -1.0,
                                          .noise = -1.0};
  memcpy(options.spread, spread[law], sizeof options.spread);
  return options;
}

double supine_patient_krige_covariance(const supine_patient_centre *a,
                                       const supine_patient_centre *b) {
  supine_kriging_point p = {.size = a->size, .lung = a->side > 0.0 ? 0U : 1U};
  supine_kriging_point q = {.size = b->size, .lung = b->side > 0.0 ? 0U : 1U};
  memcpy(p.position, a->at, sizeof p.position);
  memcpy(q.position, b->at, sizeof q.position);
  return supine_kriging_covariance(&supine_kriging_default, &p, &q);
}

static supine_patient_centre centre_of(const supine_patient_power *law,
                                       const supine_patient_row *row) {
  supine_patient_centre centre = {.side = row->place.side};
  double u[3];
  supine_patient_power_displacement(law, row, u);
  centre.size = supine_length(u);
  memcpy(centre.at, row->place.arm, sizeof centre.at); /* from the box's centre: distances count */
  return centre;
}

/* --- the terms ------------------------------------------------------------------------------- */

/* Whether the law keeps its known shape. */
static bool keeps_shape(const supine_patient_krige_options *options) {
  return options->shape_kept && options->sill >= 1.0;
}

/* Find the prior standard deviation of a term: 0 known, INFINITY free. */
static double spread_of(const supine_patient_krige_options *options, size_t term) {
  static const size_t motion[] = {0, 3, 6};
  const double unit = term < 3 ? fabs(options->mean.linear[term]) : 1.0;
  const bool kept = keeps_shape(options);
  return term == SCALE                         ? (kept ? scale_spread : 0.0)
         : term < LAW                          ? (kept ? 0.0 : options->spread[term / 3] * unit)
         : term - LAW < motion[options->moved] ? INFINITY
                                               : 0.0;
}

static double offset_of(const supine_patient_krige *k, size_t term) {
  const supine_patient_power *law = &k->law;
  const supine_patient_power *mean = &k->options.mean;
  return term == SCALE ? law->linear[0] / mean->linear[0] - 1.0
         : term < 3    ? law->linear[term] - mean->linear[term]
         : term < 6    ? log(law->powers[term - 3] / mean->powers[term - 3])
                       : law->powers[term - 3] - mean->powers[term - 3];
}

static supine_patient_power moved_by(const supine_patient_power *law, const double step[TERMS]) {
  supine_patient_power moved = *law;
  for (size_t a = 0; a < 3; ++a) {
    moved.linear[a] += step[a] + step[SCALE] * law->linear[a];
    moved.powers[a] = fmin(supine_patient_exponent_most,
                           fmax(supine_patient_exponent_least, law->powers[a] * exp(step[3 + a])));
    moved.powers[3 + a] = fmin(supine_patient_slope_most,
                               fmax(-supine_patient_slope_most, law->powers[3 + a] + step[6 + a]));
    moved.linear[3 + a] += step[9 + a];
    moved.linear[6 + a] += step[12 + a];
  }
  return moved;
}

/* --- the rows -------------------------------------------------------------------------------- */

static double noise_of(const supine_patient_krige *k, const supine_patient_row *row) {
  return k->options.noise * row->noise / sqrt(fmin(1.0, fmax(1e-12, row->weight)));
}

/* Factor the covariance of the rows: noise plus g. If the law keeps its known shape, the size of
 * g follows the least-squares size of that law.
 * @return the logarithm of half its determinant; NAN where it is not positive definite */
static double factor(supine_patient_krige *k) {
  const size_t n = k->count;
  double logarithm = 0.0;
  k->sill = k->options.sill;
  if (keeps_shape(&k->options)) {
    k->sill *= fabs(k->options.mean.linear[0] / k->law.linear[0]);
  }
  for (size_t i = 0; i < n; ++i) {
    k->centre[i] = centre_of(&k->law, &k->rows[i]);
    logarithm += k->options.sill > 0.0 ? 0.0 : log(noise_of(k, &k->rows[i]));
  }
  if (k->options.sill <= 0.0) {
    return logarithm;
  }
  for (size_t i = 0; i < n; ++i) {
    for (size_t j = 0; j <= i; ++j) {
      k->factor[i * n + j] = k->sill * supine_dot(k->rows[i].axis, k->rows[j].axis) *
                             supine_patient_krige_covariance(&k->centre[i], &k->centre[j]);
    }
    k->factor[i * n + i] += pow(noise_of(k, &k->rows[i]), 2.0);
  }
  if (LAPACKE_dpotrf(LAPACK_COL_MAJOR, 'U', (lapack_int)n, k->factor, (lapack_int)n) != 0) {
    return NAN;
  }
  for (size_t i = 0; i < n; ++i) {
    logarithm += log(k->factor[i * n + i]);
  }
  return logarithm;
}

/* Build the normal equations of the terms at the present law, and the squared residual. */
static void look(supine_patient_krige *k) {
  const int n = (int)k->count;
  for (size_t i = 0; i < k->count; ++i) {
    double *row = k->design + WIDTH * i;
    row[TERMS] = -supine_patient_power_design(&k->law, &k->rows[i], row);
    if (k->options.sill <= 0.0) {
      cblas_dscal(WIDTH, 1.0 / noise_of(k, &k->rows[i]), row, 1);
    }
  }
  if (k->options.sill > 0.0) {
    cblas_dtrsm(CblasRowMajor, CblasLeft, CblasLower, CblasNoTrans, CblasNonUnit, n, WIDTH, 1.0,
                k->factor, n, k->design, WIDTH);
  }
  cblas_dsyrk(CblasRowMajor, CblasLower, CblasTrans, TERMS, n, 1.0, k->design, WIDTH, 0.0,
              k->normal, TERMS);
  cblas_dgemv(CblasRowMajor, CblasTrans, n, TERMS, 1.0, k->design, WIDTH, k->design + TERMS, WIDTH,
              0.0, k->right, 1);
  k->squares = cblas_ddot(n, k->design + TERMS, WIDTH, k->design + TERMS, WIDTH);
  for (size_t t = 0; t < TERMS; ++t) {
    const double spread = spread_of(&k->options, t);
    if (spread == 0.0) { /* known: the row of the identity */
      k->right[t] = 0.0;
      for (size_t s = 0; s < TERMS; ++s) {
        k->normal[s < t ? t * TERMS + s : s * TERMS + t] = s == t ? 1.0 : 0.0;
      }
    } else if (isfinite(spread)) {
      k->normal[t * TERMS + t] += pow(spread, -2.0);
      k->right[t] -= offset_of(k, t) * pow(spread, -2.0);
      k->squares += pow(offset_of(k, t) / spread, 2.0);
    }
  }
}

/* Solve for a damped step; false if the matrix is singular. */
static bool find_step(const supine_patient_krige *k, double damping, double step[TERMS]) {
  double matrix[TERMS * TERMS];
  memcpy(matrix, k->normal, sizeof matrix);
  memcpy(step, k->right, TERMS * sizeof *step);
  for (size_t t = 0; t < TERMS; ++t) {
    matrix[t * TERMS + t] *= 1.0 + damping;
  }
  return LAPACKE_dposv(LAPACK_COL_MAJOR, 'U', TERMS, 1, matrix, TERMS, step, TERMS) == 0;
}

/* Minimise the squares over the law. */
static supine_status descend(supine_patient_krige *k, supine_error *error) {
  double damping = 0.0;
  look(k);
  for (size_t steps = 0; steps < STEPS && damping < damping_most; ++steps) {
    const supine_patient_power before = k->law;
    const double squares = k->squares;
    double step[TERMS];
    if (!isfinite(squares) || !find_step(k, damping, step)) {
      return supine_error_set(error, SUPINE_ERROR_NUMERICAL,
                              "the points do not determine the law, as if they lay in one plane: "
                              "give points all over the lungs");
    }
    k->law = moved_by(&before, step);
    look(k);
    if (k->squares <= squares && squares - k->squares <= settled * squares) {
      break;
    }
    const bool nearer = k->squares < squares;
    damping = nearer ? 0.1 * damping : fmax(1e-3, 10.0 * damping);
    if (!nearer) {
      k->law = before;
      look(k);
    }
  }
  return SUPINE_OK;
}

/* Find the restricted log likelihood of the rows under a sill and a noise, without its constant. */
static double likelihood_of(supine_patient_krige *k, double sill, double noise) {
  const supine_patient_power before = k->law;
  k->options.sill = sill;
  k->options.noise = noise;
  double likelihood = -factor(k);
  if (!isfinite(likelihood) || descend(k, NULL) != SUPINE_OK ||
      LAPACKE_dpotrf(LAPACK_COL_MAJOR, 'U', TERMS, k->normal, TERMS) != 0) {
    likelihood = -INFINITY;
  }
  for (size_t t = 0; t < TERMS; ++t) {
    const double spread = spread_of(&k->options, t);
    likelihood -= log(k->normal[t * TERMS + t]);
    likelihood -= spread > 0.0 && isfinite(spread) ? log(spread) : 0.0;
  }
  k->law = before;
  return likelihood - 0.5 * k->squares;
}

/* Choose the sill, then the noise, of the largest likelihood. */
static void choose(supine_patient_krige *k) {
  static const double sills[] = {1.0, 0.03, 0.003, 0.0};
  static const double noises[] = {1.0, 0.5, 0.25, 1.5, 2.0};
  static const size_t choices[2] = {sizeof sills / sizeof *sills, sizeof noises / sizeof *noises};
  const supine_patient_krige_options given = k->options;
  double best[2] = {given.sill < 0.0 ? sills[0] : given.sill,
                    given.noise < 0.0 ? noises[0] : given.noise};
  for (int which = 0; which < 2; ++which) {
    double most = -INFINITY;
    for (size_t i = 0; i < choices[which] && (which == 0 ? given.sill : given.noise) < 0.0; ++i) {
      const double tried[2] = {which == 0 ? sills[i] : best[0], which == 1 ? noises[i] : best[1]};
      const double likelihood = likelihood_of(k, tried[0], tried[1]);
      if (likelihood > most) {
        most = likelihood;
        best[which] = tried[which];
      }
    }
  }
  k->options.sill = best[0];
  k->options.noise = best[1];
}

/* Fit the law, then the correction of its residual, in units of that law's size. */
static supine_status fit(supine_patient_krige *k, supine_error *error) {
  const int n = (int)k->count;
  choose(k);
  supine_status status = isnan(factor(k)) ? SUPINE_ERROR_NUMERICAL : descend(k, error);
  if (status == SUPINE_OK && isnan(factor(k))) {
    status = SUPINE_ERROR_NUMERICAL;
  }
  if (status != SUPINE_OK) {
    return supine_error_set(error, status,
                            "the points do not determine the law, as if they lay in one plane or "
                            "were not numbers: give points all over the lungs");
  }
  look(k);
  cblas_dcopy(n, k->design + TERMS, WIDTH, k->weight, 1);
  if (k->options.sill > 0.0) {
    cblas_dtrsv(CblasRowMajor, CblasLower, CblasTrans, CblasNonUnit, n, k->factor, n, k->weight, 1);
  }
  return LAPACKE_dpotrf(LAPACK_COL_MAJOR, 'U', TERMS, k->normal, TERMS) == 0
             ? SUPINE_OK
             : supine_error_set(error, SUPINE_ERROR_NUMERICAL,
                                "the points do not determine the law, as if they lay in one plane: "
                                "give points all over the lungs");
}

supine_status supine_patient_krige_create(const supine_patient_krige_options *options,
                                          const supine_patient_row *rows, size_t count,
                                          supine_patient_krige **krige, supine_error *error) {
  supine_patient_krige *k = calloc(1, sizeof *k);
  supine_status status = SUPINE_ERROR_MEMORY;
  if (k != NULL) {
    *k = (supine_patient_krige){
        .rows = rows, .count = count, .options = *options, .law = options->mean};
    k->centre = malloc(count * sizeof *k->centre);
    k->factor = options->sill != 0.0 ? malloc(count * count * sizeof *k->factor) : NULL;
    k->design = malloc(WIDTH * count * sizeof *k->design);
    k->weight = malloc(count * sizeof *k->weight);
  }
  if (k == NULL || k->centre == NULL || (k->factor == NULL && options->sill != 0.0) ||
      k->design == NULL || k->weight == NULL) {
    (void)supine_error_set(error, status, "no memory for %zu rows", count);
  } else {
    status = fit(k, error);
  }
  if (status != SUPINE_OK) {
    supine_patient_krige_destroy(k);
    return status;
  }
  *krige = k;
  return SUPINE_OK;
}

void supine_patient_krige_destroy(supine_patient_krige *krige) {
  if (krige != NULL) {
    free(krige->centre);
    free(krige->factor);
    free(krige->design);
    free(krige->weight);
    free(krige);
  }
}

const supine_patient_power *supine_patient_krige_law(const supine_patient_krige *krige) {
  return &krige->law;
}

double supine_patient_krige_sill(const supine_patient_krige *krige) {
  return krige->options.sill;
}

double supine_patient_krige_noise(const supine_patient_krige *krige) {
  return krige->options.noise;
}

supine_status supine_patient_law_fit(const supine_patient_krige_options *options,
                                     const supine_patient_row *rows, size_t count,
                                     supine_patient_power *law, supine_error *error) {
  supine_patient_krige_options alone = *options;
  supine_patient_krige *krige = NULL;
  alone.sill = 0.0;
  alone.noise = 1.0;
  const supine_status status = supine_patient_krige_create(&alone, rows, count, &krige, error);
  if (status == SUPINE_OK) {
    *law = krige->law;
  }
  supine_patient_krige_destroy(krige);
  return status;
}

/* Solve with the triangular factor of the normal matrix, so that x . x is a variance. */
static double variance_of(const supine_patient_krige *k, double x[TERMS]) {
  cblas_dtrsv(CblasRowMajor, CblasLower, CblasNoTrans, CblasNonUnit, TERMS, k->normal, TERMS, x, 1);
  return cblas_ddot(TERMS, x, 1, x, 1);
}

void supine_patient_krige_errors(const supine_patient_krige *krige,
                                 double error[SUPINE_PATIENT_CONSTANTS]) {
  for (size_t t = 0; t < LAW; ++t) {
    const bool exponent = t >= 3 && t < 6;
    const size_t c = t < 3 ? 2 * t : exponent ? 2 * (t - 3) + 1 : t;
    double x[TERMS] = {0.0};
    x[t] = exponent ? krige->law.powers[t - 3] : 1.0;
    error[c] = spread_of(&krige->options, t) > 0.0 ? sqrt(variance_of(krige, x)) : 0.0;
  }
}

double supine_patient_krige_predict(const supine_patient_krige *krige,
                                    const supine_patient_row *row, double *variance,
                                    double *scratch) {
  const supine_patient_krige *k = krige;
  const int n = (int)k->count;
  double x[WIDTH];
  double value = supine_patient_power_design(&k->law, row, x) + row->value;
  *variance = 0.0;
  if (k->options.sill > 0.0) {
    const supine_patient_centre at = centre_of(&k->law, row);
    for (size_t i = 0; i < k->count; ++i) {
      scratch[i] = k->sill * supine_dot(row->axis, k->rows[i].axis) *
                   supine_patient_krige_covariance(&at, &k->centre[i]);
    }
    value += cblas_ddot(n, scratch, 1, k->weight, 1);
    cblas_dtrsv(CblasRowMajor, CblasLower, CblasNoTrans, CblasNonUnit, n, k->factor, n, scratch, 1);
    cblas_dgemv(CblasRowMajor, CblasTrans, n, TERMS, -1.0, k->design, WIDTH, scratch, 1, 1.0, x, 1);
    *variance =
        k->sill * supine_patient_krige_covariance(&at, &at) - cblas_ddot(n, scratch, 1, scratch, 1);
  }
  for (size_t t = 0; t < TERMS; ++t) {
    x[t] = spread_of(&k->options, t) > 0.0 ? x[t] : 0.0;
  }
  *variance = fmax(0.0, *variance) + variance_of(k, x);
  return value;
}

/* Add a row's weight to the last centre where the positions agree, else to a new centre. */
static void add_centre(const supine_patient_krige *k, size_t i, supine_patient *patient) {
  supine_patient_correction *c = &patient->correction;
  const supine_patient_frame *frame = &patient->frame;
  supine_patient_centre centre = k->centre[i];
  for (size_t a = 0; a < 3; ++a) {
    centre.at[a] += 0.5 * (frame->minimum[a] + frame->maximum[a]);
  }
  const bool same =
      c->count > 0 && memcmp(c->centre[c->count - 1].at, centre.at, sizeof centre.at) == 0;
  if (!same && c->count < SUPINE_PATIENT_CENTRES_MAX) {
    c->centre[c->count++] = centre;
  }
  for (size_t a = 0; a < 3; ++a) {
    c->centre[c->count - 1].weight[a] += k->sill * k->weight[i] * k->rows[i].axis[a];
  }
}

void supine_patient_krige_take(const supine_patient_krige *krige, supine_patient *patient) {
  supine_patient_take(&krige->law, patient);
  for (size_t i = 0; i < krige->count && krige->options.sill > 0.0; ++i) {
    if (krige->rows[i].weight > 0.0) {
      add_centre(krige, i, patient);
    }
  }
}
