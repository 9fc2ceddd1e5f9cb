/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Fit a displacement law and, by kriging, a correction of its residual. */
#include <math.h>
#include <string.h>

#include <cblas.h>
#include <lapacke.h>

#include "precompute/patient/krige.h"

#include "base/arena.h"
#include "base/vec3.h"

enum {
  TERMS = SUPINE_PATIENT_TERMS,
  MOTION =
      SUPINE_PATIENT_BY_TRANSLATION, /* first unknown of the body's motion; its rotation follows */
  SCALE = SUPINE_PATIENT_BY_SCALE,
  STEPS = 60
};

/* Prior standard deviation of the factor by which the displacement law is multiplied (assumed). */
static const double scale_deviation = 0.3;
static const double converged = 1e-10;   /* relative decrease of k->objective that ends a fit */
static const double damping_most = 1e10; /* a larger damping of the steps ends a fit */

/* Bounds of constants of the displacement law (patient.h): the exponents c2, c4 and c6, and the
 * absolute values of the slopes c7, c8 and c9. */
static const double exponent_least = 0.5, exponent_most = 4.0, slope_most = 2.5;

/* [law][3] prior standard deviations (assumed): of c1, c3 and c5, divided by their prior means; of
 * the logarithms of the exponents c2, c4 and c6; of the slopes c7, c8 and c9 (patient.h). */
static const double law_deviation[SUPINE_PATIENT_LAW_COUNT][3] = {{0.3, 0.3, 0.3}, {3.0, 1.0, 1.0}};

static supine_patient_centre centre_of(const supine_patient_power *law,
                                       const supine_patient_place *place) {
  supine_patient_centre centre = {.side = place->side};
  double u[3];
  supine_patient_direction(law, place, supine_patient_force_at(law, place), u);
  centre.size = supine_length(u);
  memcpy(centre.offset, place->offset, sizeof centre.offset);
  return centre;
}

static bool shape_is_fixed(const supine_patient_krige *k) {
  return k->options.size_only || (k->options.law == SUPINE_PATIENT_DEEP && k->sill >= 1.0);
}

/* Return an unknown's prior standard deviation: 0 if not fitted, INFINITY if without a prior. */
static double prior_deviation(const supine_patient_krige *k, size_t term) {
  const bool shape_fixed = shape_is_fixed(k);
  if (term == SCALE) {
    if (k->options.size_only) {
      return INFINITY;
    }
    return shape_fixed ? scale_deviation : 0.0;
  }
  if (term < MOTION) {
    const double unit = term < 3 ? fabs(k->mean.c[2 * term]) : 1.0;
    return shape_fixed ? 0.0 : law_deviation[k->options.law][term / 3] * unit;
  }
  return term - MOTION < (size_t)k->options.scan_motion ? INFINITY : 0.0;
}

static double offset_from_prior(const supine_patient_krige *k, size_t term) {
  const supine_patient_power *law = &k->law;
  const supine_patient_power *mean = &k->mean;
  if (term == SCALE) {
    return law->c[0] / mean->c[0] - 1.0;
  }
  if (term < 3) {
    return law->c[2 * term] - mean->c[2 * term];
  }
  if (term < 6) {
    return log(law->c[2 * term - 5] / mean->c[2 * term - 5]);
  }
  return law->c[term] - mean->c[term];
}

static supine_patient_power take_step(const supine_patient_power *law, const double step[TERMS]) {
  supine_patient_power stepped = *law;
  for (size_t a = 0; a < 3; ++a) {
    stepped.c[2 * a] += step[a] + step[SCALE] * law->c[2 * a];
    stepped.c[2 * a + 1] =
        fmin(exponent_most, fmax(exponent_least, law->c[2 * a + 1] * exp(step[3 + a])));
    stepped.c[6 + a] = fmin(slope_most, fmax(-slope_most, law->c[6 + a] + step[6 + a]));
    stepped.motion[a] += step[9 + a];
    stepped.motion[3 + a] += step[12 + a];
  }
  return stepped;
}

static double noise_of(const supine_patient_krige *k, const supine_patient_row *row) {
  return k->noise * row->noise / sqrt(fmin(1.0, fmax(1e-12, row->weight)));
}

/* Factorise the covariance matrix of the measurements: the covariance of their noise plus that of
 * the kriging correction. The correction's covariance is proportional to the predicted
 * displacement; if only the size of the displacement is fitted, its prior mean is used.
 * @return half the logarithm of the determinant; NAN if the matrix is not positive definite */
static double factor_covariance(supine_patient_krige *k) {
  const size_t n = k->count;
  double logarithm = 0.0;
  k->scaled_sill = k->sill * (shape_is_fixed(k) ? fabs(k->mean.c[0] / k->law.c[0]) : 1.0);
  for (size_t i = 0; i < n; ++i) {
    k->centre[i] = centre_of(&k->law, &k->rows[i].place);
    logarithm += k->sill > 0.0 ? 0.0 : log(noise_of(k, &k->rows[i]));
  }
  if (k->sill <= 0.0) {
    return logarithm;
  }
  for (size_t i = 0; i < n; ++i) {
    supine_patient_covariances(&k->centre[i], i + 1, k->centre, k->cholesky + i * n);
    for (size_t j = 0; j <= i; ++j) {
      k->cholesky[i * n + j] *= k->scaled_sill * supine_dot(k->rows[i].axis, k->rows[j].axis);
    }
    k->cholesky[i * n + i] += pow(noise_of(k, &k->rows[i]), 2.0);
  }
  if (LAPACKE_dpotrf(LAPACK_COL_MAJOR, 'U', (lapack_int)n, k->cholesky, (lapack_int)n) != 0) {
    return NAN;
  }
  for (size_t i = 0; i < n; ++i) {
    logarithm += log(k->cholesky[i * n + i]);
  }
  return logarithm;
}

static void add_prior(supine_patient_krige *k) {
  for (size_t t = 0; t < TERMS; ++t) {
    const double deviation = prior_deviation(k, t);
    if (deviation == 0.0) { /* the unknown is not fitted: make its step 0 */
      k->right_side[t] = 0.0;
      for (size_t s = 0; s < TERMS; ++s) {
        k->normal_matrix[s < t ? t * TERMS + s : s * TERMS + t] = s == t ? 1.0 : 0.0;
      }
    } else if (isfinite(deviation)) {
      k->normal_matrix[t * TERMS + t] += pow(deviation, -2.0);
      k->right_side[t] -= offset_from_prior(k, t) * pow(deviation, -2.0);
      k->objective += pow(offset_from_prior(k, t) / deviation, 2.0);
    }
  }
}

/* Compute the normal equations and k->objective at the present k->law. */
static void linearise(supine_patient_krige *k) {
  const int n = (int)k->count;
  const int width = TERMS + 1; /* one column for each unknown, and one for the residual */
  for (size_t i = 0; i < k->count; ++i) {
    double *row = k->design + (size_t)width * i;
    row[TERMS] = -supine_patient_power_design(&k->law, &k->rows[i], row);
    if (k->sill <= 0.0) {
      cblas_dscal(width, 1.0 / noise_of(k, &k->rows[i]), row, 1);
    }
  }
  if (k->sill > 0.0) {
    cblas_dtrsm(CblasRowMajor, CblasLeft, CblasLower, CblasNoTrans, CblasNonUnit, n, width, 1.0,
                k->cholesky, n, k->design, width);
  }
  cblas_dsyrk(CblasRowMajor, CblasLower, CblasTrans, TERMS, n, 1.0, k->design, width, 0.0,
              k->normal_matrix, TERMS);
  cblas_dgemv(CblasRowMajor, CblasTrans, n, TERMS, 1.0, k->design, width, k->design + TERMS, width,
              0.0, k->right_side, 1);
  k->objective = cblas_ddot(n, k->design + TERMS, width, k->design + TERMS, width);
  add_prior(k);
}

/* Solve the damped normal equations for a step of all unknowns. Return false on failure. */
static bool find_step(const supine_patient_krige *k, double damping, double step[TERMS]) {
  double *matrix = k->normal_matrix + TERMS * TERMS;
  memcpy(matrix, k->normal_matrix, TERMS * TERMS * sizeof *matrix);
  memcpy(step, k->right_side, TERMS * sizeof *step);
  for (size_t t = 0; t < TERMS; ++t) {
    matrix[t * TERMS + t] *= 1.0 + damping;
  }
  return LAPACKE_dposv(LAPACK_COL_MAJOR, 'U', TERMS, 1, matrix, TERMS, step, TERMS) == 0;
}

static bool factor_normal_matrix(supine_patient_krige *k) {
  return LAPACKE_dpotrf(LAPACK_COL_MAJOR, 'U', TERMS, k->normal_matrix, TERMS) == 0;
}

/* Minimise k->objective. Return false if the measurements do not determine the unknowns. */
static bool descend(supine_patient_krige *k) {
  double damping = 0.0;
  linearise(k);
  for (size_t steps = 0; steps < STEPS && damping < damping_most; ++steps) {
    const supine_patient_power before = k->law;
    const double squares = k->objective;
    double step[TERMS];
    if (!isfinite(squares) || !find_step(k, damping, step)) {
      return false;
    }
    k->law = take_step(&before, step);
    linearise(k);
    if (k->objective <= squares && squares - k->objective <= converged * squares) {
      break;
    }
    const bool decreased = k->objective < squares;
    damping = decreased ? 0.1 * damping : fmax(1e-3, 10.0 * damping);
    if (!decreased) {
      k->law = before;
      linearise(k);
    }
  }
  return true;
}

/* Return the restricted log likelihood of the measurements, up to a constant, if the covariance of
 * the kriging correction is multiplied by `sill` and the noise by `noise`. */
static double likelihood_of(supine_patient_krige *k, double sill, double noise) {
  const supine_patient_power before = k->law;
  k->sill = sill;
  k->noise = noise;
  double likelihood = -factor_covariance(k);
  if (!isfinite(likelihood) || !descend(k) || !factor_normal_matrix(k)) {
    likelihood = -INFINITY;
  }
  for (size_t t = 0; t < TERMS; ++t) {
    const double deviation = prior_deviation(k, t);
    likelihood -= log(k->normal_matrix[t * TERMS + t]);
    likelihood -= deviation > 0.0 && isfinite(deviation) ? log(deviation) : 0.0;
  }
  k->law = before;
  return likelihood - 0.5 * k->objective;
}

/* Choose the most likely k->sill, then k->noise, then k->sill. Keep values given in `options`. */
static void choose_factors(supine_patient_krige *k, const supine_patient_fit_options *options) {
  static const double choices[2][5] = {{1.0, 0.03, 0.003, 0.0}, {1.0, 0.5, 0.25, 1.5, 2.0}};
  static const size_t count[2] = {4, 5};
  const bool given[2] = {options->uncorrected || options->sill > 0.0, options->noise > 0.0};
  double best[2] = {given[0] ? options->sill : 1.0, given[1] ? options->noise : 1.0};
  if (options->uncorrected) {
    best[0] = 0.0;
  }
  for (int pass = 0; pass < (given[0] || given[1] ? 2 : 3); ++pass) {
    const int which = pass % 2;
    double most = -INFINITY;
    if (given[which]) {
      continue;
    }
    for (size_t i = 0; i < count[which]; ++i) {
      const double tried[2] = {which == 0 ? choices[0][i] : best[0],
                               which == 1 ? choices[1][i] : best[1]};
      const double likelihood = likelihood_of(k, tried[0], tried[1]);
      if (likelihood > most) {
        most = likelihood;
        best[which] = choices[which][i];
      }
    }
  }
  k->sill = best[0];
  k->noise = best[1];
}

static bool fit_uncorrected(supine_patient_krige *k, bool size_only) {
  k->sill = 0.0;
  k->noise = 1.0;
  k->options.size_only = size_only;
  k->law = k->mean;
  (void)factor_covariance(k);
  const bool determined = descend(k);
  k->options.size_only = false;
  k->uncorrected_law = k->law;
  return determined;
}

static supine_status krige_create(supine_patient_krige *k,
                                  const supine_patient_fit_options *options,
                                  const supine_patient_row *rows, size_t count,
                                  supine_error *error) {
  supine_arena *a = &k->arena;
  *k = (supine_patient_krige){.rows = rows,
                              .count = count,
                              .options = *options,
                              .mean = supine_patient_deep(options->gravity, options->path_span)};
  size_t thirds = 0; /* three times the number of points: a landmark has three measurements */
  for (size_t i = 0; i < count; ++i) {
    thirds += rows[i].landmark > 0 ? 1 : 3;
  }
  SUPINE_REFUSE_IF(!options->uncorrected && thirds > 3 * SUPINE_PATIENT_CENTRES_MAX, error,
                   SUPINE_ERROR_FORMAT,
                   "%zu points to fit, more than %d: leave landmarks out, evenly over the lungs",
                   thirds / 3, SUPINE_PATIENT_CENTRES_MAX);
  k->centre = supine_arena_take(a, count, sizeof *k->centre);
  k->design = supine_arena_take(a, (TERMS + 1) * count, sizeof *k->design);
  k->normal_matrix = supine_arena_take(a, (size_t)2 * TERMS * TERMS, sizeof *k->normal_matrix);
  k->kernel_weight = supine_arena_take(a, count, sizeof *k->kernel_weight);
  if (!options->uncorrected && !options->size_only) {
    k->cholesky = supine_arena_take(a, count * count, sizeof *k->cholesky);
  }
  return supine_arena_check(a, error, "%zu values", count);
}

void supine_patient_krige_free(supine_patient_krige *krige) {
  supine_arena_free(&krige->arena);
}

static supine_status undetermined(supine_error *error) {
  return supine_error_set(error, SUPINE_ERROR_NUMERICAL,
                          "the points do not determine the displacement law: give points that are "
                          "spread over the lungs and do not lie in one plane");
}

supine_status supine_patient_krige_fit(const supine_patient_fit_options *options,
                                       const supine_patient_row *rows, size_t count,
                                       supine_patient_krige *krige, supine_error *error) {
  supine_patient_krige *k = krige;
  const int n = (int)count;
  SUPINE_TRY(krige_create(k, options, rows, count, error));
  bool determined = fit_uncorrected(k, true);
  k->mean = k->law;
  if (options->size_only) {
    return determined ? SUPINE_OK : undetermined(error);
  }
  if (!determined || (k->options.law != SUPINE_PATIENT_DEEP && !fit_uncorrected(k, false))) {
    return undetermined(error);
  }
  k->law = k->mean;
  choose_factors(k, options);
  /* Factorise again after the fit, because the covariance depends on the fitted displacement. */
  determined = !isnan(factor_covariance(k)) && descend(k) && !isnan(factor_covariance(k));
  linearise(k);
  if (!determined || !factor_normal_matrix(k)) {
    return undetermined(error);
  }
  cblas_dcopy(n, k->design + TERMS, TERMS + 1, k->kernel_weight, 1);
  if (k->sill > 0.0) {
    cblas_dtrsv(CblasRowMajor, CblasLower, CblasTrans, CblasNonUnit, n, k->cholesky, n,
                k->kernel_weight, 1);
  }
  return SUPINE_OK;
}

/* Return x^T C x, where C is the posterior covariance matrix of the unknowns. Overwrite x. */
static double variance_of(const supine_patient_krige *k, double x[TERMS]) {
  cblas_dtrsv(CblasRowMajor, CblasLower, CblasNoTrans, CblasNonUnit, TERMS, k->normal_matrix, TERMS,
              x, 1);
  return cblas_ddot(TERMS, x, 1, x, 1);
}

/* Return the index of the constant c1 to c9 of an unknown of the displacement law. */
static size_t constant_of(size_t term) {
  if (term < SUPINE_PATIENT_BY_EXPONENT) {
    return 2 * term; /* c1, c3, c5 */
  }
  if (term < SUPINE_PATIENT_BY_SLOPE) {
    return 2 * term - 5; /* c2, c4, c6 */
  }
  return term;
}

void supine_patient_krige_errors(const supine_patient_krige *krige,
                                 double error[SUPINE_PATIENT_CONSTANTS]) {
  for (size_t t = 0; t < MOTION; ++t) {
    const bool exponent = t >= 3 && t < 6;
    const size_t c = constant_of(t);
    double x[TERMS] = {0.0};
    x[t] = exponent ? krige->law.c[c] : 1.0;
    error[c] = prior_deviation(krige, t) > 0.0 ? sqrt(variance_of(krige, x)) : 0.0;
  }
}

void supine_patient_krige_copy_law(const supine_patient_krige *krige, supine_patient *patient) {
  patient->power = krige->law;
  patient->centre_count = 0;
  patient->landmark_count = 0;
  if (krige->sill <= 0.0) {
    return;
  }
  for (size_t i = 0; i < krige->count; ++i) {
    const supine_patient_centre centre = krige->centre[i];
    supine_patient_centre *last = patient->centre + patient->centre_count;
    if (krige->rows[i].weight <= 0.0) {
      continue;
    }
    /* The three measurements of a landmark share one element of patient->centre. */
    if (patient->centre_count == 0 ||
        memcmp(last[-1].offset, centre.offset, sizeof centre.offset) != 0) {
      ++patient->centre_count;
      *last++ = centre;
      if (krige->rows[i].landmark > 0) {
        supine_patient_landmark *landmark = &patient->landmark[patient->landmark_count++];
        *landmark = (supine_patient_landmark){.side = centre.side};
        memcpy(landmark->offset, centre.offset, sizeof landmark->offset);
      }
    }
    for (size_t a = 0; a < 3; ++a) {
      last[-1].weight[a] += krige->scaled_sill * krige->kernel_weight[i] * krige->rows[i].axis[a];
    }
  }
}
