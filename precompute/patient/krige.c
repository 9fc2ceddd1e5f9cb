/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Law + kriging. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <cblas.h>
#include <lapacke.h>

#include "precompute/patient/krige.h"

#include "runtime/kriging.h"
#include "sh/base/vec3.h"

enum { LANDMARKS_MAX = 300 };

static const double scale_prior = 0.3;
static const double shift_prior = 100.0; /* mm */
static const double turn_prior = 0.3;    /* rad */

struct supine_patient_krige {
  const supine_patient_row *rows;
  size_t count;
  supine_patient_power law;
  supine_patient_krige_options options;
  double noise;                  /* factor on the rows' */
  double sill;                   /* factor on the covariance of g */
  supine_patient_centre *centre; /* [count] of each row, without weight */
  double *factor;                /* [count, count] of the covariance (Cholesky) */
  double *weight;                /* [count] */
  double *along;                 /* [count] law's displacement along each row's axis, mm */
};

double supine_patient_krige_size(double scale, const double u[3]) {
  return fabs(scale) * supine_length(u);
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
  centre.size = supine_patient_krige_size(1.0, u);
  memcpy(centre.at, row->place.arm, sizeof centre.at); /* from the box's centre: distances alone */
  return centre;
}

static double along_of(const supine_patient_power *law, const supine_patient_row *row) {
  double u[3];
  supine_patient_power_displacement(law, row, u);
  return supine_dot(row->axis, u);
}

static double scale_variance(const supine_patient_krige *k) {
  return k->options.scale_known ? 0.0 : scale_prior * scale_prior;
}

/* The covariance of two rows, with what the scale and the motion add. */
static double covary(const supine_patient_krige *k, const supine_patient_row *a,
                     const supine_patient_centre *at, double along, size_t b) {
  const supine_patient_row *row = &k->rows[b];
  const double same = supine_dot(a->axis, row->axis);
  double sum = k->sill * same * supine_patient_krige_covariance(at, &k->centre[b]) +
               scale_variance(k) * along * k->along[b];
  if (k->options.moved != SUPINE_PATIENT_STILL) {
    sum += shift_prior * shift_prior * same;
  }
  if (k->options.moved == SUPINE_PATIENT_RIGID) {
    double turn[2][3];
    supine_cross(a->place.arm, a->axis, turn[0]);
    supine_cross(row->place.arm, row->axis, turn[1]);
    sum += turn_prior * turn_prior * supine_dot(turn[0], turn[1]);
  }
  return sum;
}

/* The covariance of all rows, without noise, into the lower triangle. */
static void fill(const supine_patient_krige *k, double *matrix) {
  for (size_t i = 0; i < k->count; ++i) {
    for (size_t j = 0; j <= i; ++j) {
      matrix[i * k->count + j] = covary(k, &k->rows[i], &k->centre[i], k->along[i], j);
    }
  }
}

/* Factor the covariance under so much noise, and solve for the weights.
 * @return the log likelihood, without its constant; -INFINITY where the matrix is not positive */
static double solve(supine_patient_krige *k, const double *matrix, double noise) {
  const size_t n = k->count;
  const lapack_int size = (lapack_int)n;
  double likelihood = 0.0;
  memcpy(k->factor, matrix, n * n * sizeof *matrix);
  for (size_t i = 0; i < n; ++i) {
    const supine_patient_row *row = &k->rows[i];
    /* A row of no weight has noise without end. */
    k->factor[i * n + i] += pow(noise * row->noise, 2.0) / fmin(1.0, fmax(1e-12, row->weight));
    k->weight[i] = -supine_patient_power_residual(&k->law, row);
    likelihood += k->weight[i];
  }
  if (!isfinite(likelihood) || LAPACKE_dpotrf(LAPACK_COL_MAJOR, 'U', size, k->factor, size) != 0) {
    return -INFINITY;
  }
  cblas_dtrsv(CblasRowMajor, CblasLower, CblasNoTrans, CblasNonUnit, (int)n, k->factor, (int)n,
              k->weight, 1);
  likelihood = -0.5 * cblas_ddot((int)n, k->weight, 1, k->weight, 1);
  for (size_t i = 0; i < n; ++i) {
    likelihood -= log(k->factor[i * n + i]);
  }
  cblas_dtrsv(CblasRowMajor, CblasLower, CblasTrans, CblasNonUnit, (int)n, k->factor, (int)n,
              k->weight, 1);
  return likelihood;
}

/* Take the noise that makes the rows most likely; of a law that was fitted in full as well the
 * share of g's covariance, or none. */
static supine_status choose_noise(supine_patient_krige *k, supine_error *error) {
  static const double factors[] = {0.25, 0.5, 1.5, 2.0, 1.0};
  static const double sills[] = {0.0, 0.01, 0.1, 1.0};
  enum { FACTORS = sizeof factors / sizeof *factors, SILLS = sizeof sills / sizeof *sills };
  double *matrix = malloc(k->count * k->count * sizeof *matrix);
  double best[2] = {1.0, 1.0}; /* noise, sill */
  double most = -INFINITY;
  if (matrix == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu rows", k->count);
  }
  for (size_t g = k->options.scale_known ? 0 : SILLS - 1; g < SILLS; ++g) {
    k->sill = sills[g];
    fill(k, matrix);
    for (size_t f = k->options.noise_known ? FACTORS - 1 : 0; f < FACTORS; ++f) {
      const double likelihood = solve(k, matrix, factors[f]);
      if (likelihood > most) {
        most = likelihood;
        best[0] = factors[f];
        best[1] = k->sill;
      }
    }
  }
  k->noise = best[0];
  k->sill = best[1];
  fill(k, matrix);
  most = solve(k, matrix, k->noise);
  free(matrix);
  return isfinite(most) ? SUPINE_OK
                        : supine_error_set(error, SUPINE_ERROR_NUMERICAL,
                                           "the points' covariance is not positive definite");
}

supine_status supine_patient_krige_create(const supine_patient_power *law,
                                          const supine_patient_row *rows, size_t count,
                                          const supine_patient_krige_options *options,
                                          supine_patient_krige **krige, supine_error *error) {
  supine_patient_krige *k = calloc(1, sizeof *k);
  if (k != NULL) {
    *k = (supine_patient_krige){.rows = rows, .count = count, .law = *law, .options = *options};
    k->centre = malloc(count * sizeof *k->centre);
    k->factor = malloc(count * count * sizeof *k->factor);
    k->weight = malloc(count * sizeof *k->weight);
    k->along = malloc(count * sizeof *k->along);
  }
  if (k == NULL || k->centre == NULL || k->factor == NULL || k->weight == NULL ||
      k->along == NULL) {
    supine_patient_krige_destroy(k);
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu rows", count);
  }
  for (size_t i = 0; i < count; ++i) {
    k->centre[i] = centre_of(law, &rows[i]);
    k->along[i] = along_of(law, &rows[i]);
  }
  const supine_status status = choose_noise(k, error);
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
    free(krige->weight);
    free(krige->along);
    free(krige);
  }
}

double supine_patient_krige_noise(const supine_patient_krige *krige) {
  return krige->noise;
}

double supine_patient_krige_predict(const supine_patient_krige *krige,
                                    const supine_patient_row *row, double *variance,
                                    double *scratch) {
  const supine_patient_krige *k = krige;
  const supine_patient_centre at = centre_of(&k->law, row);
  const double along = along_of(&k->law, row);
  double value = supine_patient_power_residual(&k->law, row) + row->value;
  const int n = (int)k->count;
  for (size_t i = 0; i < k->count; ++i) {
    scratch[i] = covary(k, row, &at, along, i);
    value += scratch[i] * k->weight[i];
  }
  if (variance != NULL) {
    double turn[3];
    supine_cross(row->place.arm, row->axis, turn);
    *variance =
        k->sill * supine_patient_krige_covariance(&at, &at) + scale_variance(k) * along * along;
    *variance += k->options.moved != SUPINE_PATIENT_STILL ? shift_prior * shift_prior : 0.0;
    *variance += k->options.moved == SUPINE_PATIENT_RIGID
                     ? turn_prior * turn_prior * supine_dot(turn, turn)
                     : 0.0;
    cblas_dtrsv(CblasRowMajor, CblasLower, CblasNoTrans, CblasNonUnit, n, k->factor, n, scratch, 1);
    *variance = fmax(0.0, *variance - cblas_ddot(n, scratch, 1, scratch, 1));
  }
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
  const supine_patient_krige *k = krige;
  double scale = 1.0;
  double motion[6] = {0.0};
  patient->correction = (supine_patient_correction){.count = 0};
  for (size_t i = 0; i < k->count; ++i) {
    const supine_patient_row *row = &k->rows[i];
    double turn[3];
    supine_cross(row->place.arm, row->axis, turn);
    scale += scale_variance(k) * k->along[i] * k->weight[i];
    for (size_t a = 0; a < 3; ++a) {
      motion[a] += shift_prior * shift_prior * row->axis[a] * k->weight[i];
      motion[3 + a] += turn_prior * turn_prior * turn[a] * k->weight[i];
    }
    if (k->sill > 0.0) {
      add_centre(k, i, patient);
    }
  }
  patient->correction.scale = 1.0 / scale;
  memcpy(patient->powers, k->law.powers, sizeof patient->powers);
  for (size_t a = 0; a < 3; ++a) {
    patient->lengths[a] = scale * k->law.linear[a];
  }
  for (size_t a = 0; a < 6; ++a) {
    const bool free = k->options.moved == SUPINE_PATIENT_RIGID ||
                      (k->options.moved == SUPINE_PATIENT_TRANSLATION && a < 3);
    patient->motion[a] = k->law.linear[3 + a] + (free ? motion[a] : 0.0);
  }
}

size_t supine_patient_krige_thin(const supine_patient_row *rows, size_t single, size_t triples,
                                 supine_patient_row *thinned) {
  const size_t landmarks = triples < LANDMARKS_MAX ? triples : LANDMARKS_MAX;
  const size_t room = SUPINE_PATIENT_CENTRES_MAX - landmarks;
  size_t matched = 0;
  size_t seen = 0;
  size_t count = 0;
  for (size_t i = 0; i < single; ++i) {
    matched += rows[i].weight > 0.0;
  }
  for (size_t i = 0; i < single; ++i) {
    if (rows[i].weight > 0.0) { /* every (matched / room)-th */
      if (matched <= room || (seen * room) / matched != ((seen + 1) * room) / matched) {
        thinned[count++] = rows[i];
      }
      ++seen;
    }
  }
  for (size_t i = 0; i < landmarks; ++i) {
    memcpy(thinned + count, rows + single + 3 * (i * triples / landmarks), 3 * sizeof *rows);
    count += 3;
  }
  return count;
}
