/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The paper's law (15)-(18): lengths and motion by linear least squares inside, exponents and the
 * force's slopes by Levenberg-Marquardt outside. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <gsl/gsl_multifit_nlinear.h>
#include <lapacke.h>

#include "precompute/patient/rows.h"

enum { P = SUPINE_PATIENT_POWERS, LINEAR_MAX = 9 };

/* Bounds of c2, c4, c6 and of c7, c8, c9. Exponents beyond these bend all motion into a face;
 * slopes beyond let the force change sign. */
static const double exponent_least = 0.5, exponent_most = 4.0, slope_most = 2.5;

/* Pulls what the data leave open (mm^2 for a factor of e) towards a common exponent and an even
 * force; what they do say outweighs it by orders of magnitude. */
static const double common_exponent = 1.5;
static const double pull = 0.25;

/* As near to a bound as this share of the range is at it. */
static const double bound_share = 0.002;

const double supine_patient_starts[SUPINE_PATIENT_STARTS][P] = {
    {1.5, 1.5, 1.5, 0.0, 0.0, 0.0},   {2.6, 1.0, 1.3, 0.0, -0.6, 0.0},
    {0.7, 2.3, 0.9, 0.4, 0.3, -0.5},  {3.7, 0.6, 2.8, -0.5, -0.9, 0.6},
    {1.1, 3.1, 0.6, -0.8, 0.7, 0.35}, {0.5, 0.8, 3.6, 0.7, -0.2, -0.8}};

static void range_of(size_t k, double range[2]) {
  range[0] = k < 3 ? exponent_least : -slope_most;
  range[1] = k < 3 ? exponent_most : slope_most;
}

/* Unbounded variables for bounded ones: middle + half sin(q), which does not go flat far from the
 * bounds, so that a step that went too far comes back. */
static void unbound(const double powers[P], gsl_vector *q) {
  for (size_t k = 0; k < P; ++k) {
    double range[2];
    range_of(k, range);
    const double t = (2.0 * powers[k] - range[0] - range[1]) / (range[1] - range[0]);
    gsl_vector_set(q, k, asin(fmin(0.99, fmax(-0.99, t))));
  }
}

static void bound(const gsl_vector *q, double powers[P]) {
  for (size_t k = 0; k < P; ++k) {
    double range[2];
    range_of(k, range);
    powers[k] =
        0.5 * (range[0] + range[1]) + 0.5 * (range[1] - range[0]) * sin(gsl_vector_get(q, k));
  }
}

/* What a row has of each linear unknown. Logarithms of its box coordinates are kept, as powers are
 * taken of them again and again. */
static void design_row(const supine_patient_row *row, const double logs[3], const double powers[P],
                       double design[LINEAR_MAX]) {
  const double force = row->force[0] + powers[3] * row->force[1] + powers[4] * row->force[2] +
                       powers[5] * row->force[3]; /* (18) */
  for (size_t a = 0; a < 3; ++a) {
    const size_t b = (a + 1) % 3;
    const size_t c = (a + 2) % 3;
    const double sign = a == 0 ? row->place.side : -1.0;
    design[a] = row->axis[a] == 0.0
                    ? 0.0
                    : row->axis[a] * sign * force * exp(powers[a] * logs[a]); /* (15)-(17) */
    design[3 + a] = row->axis[a];
    design[6 + a] = row->axis[c] * row->place.arm[b] - row->axis[b] * row->place.arm[c];
  }
}

static void take_logs(const supine_patient_row *row, double logs[3]) {
  for (size_t a = 0; a < 3; ++a) {
    logs[a] = log(fmin(1.0, fmax(1e-12, row->place.box[a])));
  }
}

typedef struct problem {
  const supine_patient_row *rows;
  size_t count;
  size_t linear_count; /* 3, 6 or 9 */
  double *design;      /* [count, LINEAR_MAX] */
  double *logs;        /* [count, 3] */
  double linear[LINEAR_MAX];
  double factor[LINEAR_MAX * LINEAR_MAX]; /* of their normal equations, scaled (Cholesky) */
  double scale[LINEAR_MAX];
} problem;

/* The best linear unknowns at some powers. */
static bool solve_linear(problem *p, const double powers[P]) {
  const size_t m = p->linear_count;
  double *matrix = p->factor;
  double *scale = p->scale;
  memset(matrix, 0, sizeof p->factor);
  memset(p->linear, 0, sizeof p->linear);
  for (size_t i = 0; i < p->count; ++i) {
    double *design = p->design + LINEAR_MAX * i;
    const supine_patient_row *row = &p->rows[i];
    design_row(row, p->logs + 3 * i, powers, design);
    for (size_t a = 0; a < m; ++a) {
      if (design[a] == 0.0) {
        continue;
      }
      for (size_t b = 0; b <= a; ++b) {
        matrix[a * m + b] += row->weight * design[a] * design[b];
      }
      p->linear[a] += row->weight * design[a] * row->value;
    }
  }
  for (size_t a = 0; a < m; ++a) {
    scale[a] = matrix[a * m + a] > 0.0 ? 1.0 / sqrt(matrix[a * m + a]) : 1.0;
  }
  for (size_t a = 0; a < m; ++a) {
    for (size_t b = 0; b <= a; ++b) {
      matrix[a * m + b] *= scale[a] * scale[b];
    }
    matrix[a * m + a] += 1e-10;
    p->linear[a] *= scale[a];
  }
  const lapack_int size = (lapack_int)m;
  if (LAPACKE_dposv(LAPACK_COL_MAJOR, 'U', size, 1, matrix, size, p->linear, size) != 0) {
    return false;
  }
  for (size_t a = 0; a < m; ++a) {
    p->linear[a] *= scale[a];
  }
  return true;
}

static double left_of_row(const problem *p, size_t i) {
  const double *design = p->design + LINEAR_MAX * i;
  double left = -p->rows[i].value;
  for (size_t a = 0; a < p->linear_count; ++a) {
    left += design[a] * p->linear[a];
  }
  return left;
}

static int residuals(const gsl_vector *q, void *context, gsl_vector *left) {
  problem *p = context;
  double powers[P];
  bound(q, powers);
  if (!solve_linear(p, powers)) {
    return GSL_EDOM;
  }
  for (size_t i = 0; i < p->count; ++i) {
    gsl_vector_set(left, i, sqrt(p->rows[i].weight) * left_of_row(p, i));
  }
  for (size_t k = 0; k < P; ++k) {
    gsl_vector_set(left, p->count + k,
                   sqrt(pull) * (k < 3 ? log(powers[k] / common_exponent) : powers[k]));
  }
  return GSL_SUCCESS;
}

/* Derivatives of the residuals by the unbounded variables, as if the linear unknowns' part in them
 * were the projection of what the design changes by (Kaufman):
 *
 *     J = (1 - D (D^T W D)^-1 D^T W) dD/dq c */
static int derivatives(const gsl_vector *q, void *context, gsl_matrix *jacobian) {
  problem *p = context;
  const size_t m = p->linear_count;
  double powers[P];
  double by_q[P];
  double projected[LINEAR_MAX * P] = {0};
  bound(q, powers);
  if (!solve_linear(p, powers)) {
    return GSL_EDOM;
  }
  for (size_t k = 0; k < P; ++k) {
    double range[2];
    range_of(k, range);
    by_q[k] = 0.5 * (range[1] - range[0]) * cos(gsl_vector_get(q, k));
  }
  for (size_t i = 0; i < p->count; ++i) {
    const supine_patient_row *row = &p->rows[i];
    const double *design = p->design + LINEAR_MAX * i;
    const double *logs = p->logs + 3 * i;
    const double root = sqrt(row->weight);
    const double force = row->force[0] + powers[3] * row->force[1] + powers[4] * row->force[2] +
                         powers[5] * row->force[3];
    const double moved =
        design[0] * p->linear[0] + design[1] * p->linear[1] + design[2] * p->linear[2];
    for (size_t k = 0; k < P; ++k) {
      const double change = k < 3          ? design[k] * logs[k] * p->linear[k]
                            : force != 0.0 ? moved / force * row->force[k - 2]
                                           : 0.0;
      gsl_matrix_set(jacobian, i, k, root * change * by_q[k]);
      for (size_t a = 0; a < m; ++a) {
        projected[k * m + a] += row->weight * design[a] * p->scale[a] * change * by_q[k];
      }
    }
  }
  const lapack_int size = (lapack_int)m;
  if (LAPACKE_dpotrs(LAPACK_COL_MAJOR, 'U', size, P, p->factor, size, projected, size) != 0) {
    return GSL_EDOM;
  }
  for (size_t i = 0; i < p->count; ++i) {
    const double *design = p->design + LINEAR_MAX * i;
    const double root = sqrt(p->rows[i].weight);
    double *row = gsl_matrix_ptr(jacobian, i, 0);
    for (size_t a = 0; a < m; ++a) {
      for (size_t k = 0; k < P && design[a] != 0.0; ++k) {
        row[k] -= root * design[a] * p->scale[a] * projected[k * m + a];
      }
    }
  }
  for (size_t j = 0; j < P; ++j) {
    for (size_t k = 0; k < P; ++k) {
      gsl_matrix_set(jacobian, p->count + j, k,
                     j != k ? 0.0 : sqrt(pull) * by_q[k] / (k < 3 ? powers[k] : 1.0));
    }
  }
  return GSL_SUCCESS;
}

static void take(problem *p, const gsl_vector *q, supine_patient_power *fit) {
  memset(fit, 0, sizeof *fit);
  bound(q, fit->powers);
  (void)solve_linear(p, fit->powers);
  memcpy(fit->linear, p->linear, sizeof fit->linear);
  for (size_t i = 0; i < p->count; ++i) {
    fit->squares += p->rows[i].weight * pow(left_of_row(p, i), 2.0);
  }
  for (size_t k = 0; k < P; ++k) {
    double range[2];
    range_of(k, range);
    fit->pulled += pull * pow(k < 3 ? log(fit->powers[k] / common_exponent) : fit->powers[k], 2.0);
    const double t = (fit->powers[k] - range[0]) / (range[1] - range[0]);
    fit->at_bound[k] = t < bound_share || t > 1.0 - bound_share;
  }
}

/* Eight parameters: the rows, the bounds, and what comes of them. */
supine_status supine_patient_power_fit(const supine_patient_row *rows, size_t count,
                                       supine_patient_moved moved, const double powers[P],
                                       size_t steps, double tolerance, supine_patient_power *fit,
                                       supine_error *error) {
  gsl_multifit_nlinear_parameters settings = gsl_multifit_nlinear_default_parameters();
  settings.trs = gsl_multifit_nlinear_trs_lm;
  settings.solver = gsl_multifit_nlinear_solver_cholesky;
  problem p = {.rows = rows,
               .count = count,
               .linear_count = moved == SUPINE_PATIENT_STILL         ? 3
                               : moved == SUPINE_PATIENT_TRANSLATION ? 6
                                                                     : 9,
               .design = malloc(LINEAR_MAX * count * sizeof(double)),
               .logs = malloc(3 * count * sizeof(double))};
  gsl_multifit_nlinear_fdf system = {
      .f = residuals, .df = derivatives, .n = count + P, .p = P, .params = &p};
  gsl_multifit_nlinear_workspace *work =
      gsl_multifit_nlinear_alloc(gsl_multifit_nlinear_trust, &settings, count + P, P);
  gsl_vector *q = gsl_vector_alloc(P);
  supine_status status = SUPINE_OK;
  if (p.design == NULL || p.logs == NULL || work == NULL || q == NULL) {
    status = supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory to fit %zu rows", count);
    goto cleanup;
  }
  for (size_t i = 0; i < count; ++i) {
    take_logs(&rows[i], p.logs + 3 * i);
  }
  int info = 0;
  unbound(powers, q);
  if (gsl_multifit_nlinear_init(q, &system, work) != GSL_SUCCESS) {
    status = supine_error_set(error, SUPINE_ERROR_NUMERICAL,
                              "the points do not determine the law: they may lie in one plane");
    goto cleanup;
  }
  /* Steps that no longer help are how it ends at a bound: what counts is where it stands. */
  (void)gsl_multifit_nlinear_driver(steps, tolerance, tolerance, 0.0, NULL, NULL, &info, work);
  take(&p, gsl_multifit_nlinear_position(work), fit);
cleanup:
  if (q != NULL) {
    gsl_vector_free(q);
  }
  if (work != NULL) {
    gsl_multifit_nlinear_free(work);
  }
  free(p.design);
  free(p.logs);
  return status;
}

double supine_patient_power_residual(const supine_patient_power *fit,
                                     const supine_patient_row *row) {
  double design[LINEAR_MAX];
  double logs[3];
  double left = -row->value;
  take_logs(row, logs);
  design_row(row, logs, fit->powers, design);
  for (size_t a = 0; a < LINEAR_MAX; ++a) {
    left += design[a] * fit->linear[a];
  }
  return left;
}

double supine_patient_power_along(const supine_patient_power *fit, const supine_patient_row *row) {
  supine_patient_row one = *row;
  double design[LINEAR_MAX];
  double logs[3];
  one.force[0] = 1.0;
  one.force[1] = one.force[2] = one.force[3] = 0.0;
  take_logs(row, logs);
  design_row(&one, logs, fit->powers, design);
  return design[0] * fit->linear[0] + design[1] * fit->linear[1] + design[2] * fit->linear[2];
}

void supine_patient_power_displacement(const supine_patient_power *fit,
                                       const supine_patient_row *row, double u[3]) {
  supine_patient_row one = *row;
  double design[LINEAR_MAX];
  double logs[3];
  take_logs(row, logs);
  one.axis[0] = one.axis[1] = one.axis[2] = 1.0;
  design_row(&one, logs, fit->powers, design);
  for (size_t a = 0; a < 3; ++a) {
    u[a] = design[a] * fit->linear[a];
  }
}

supine_status supine_patient_scale_fit(const supine_patient_row *rows, size_t count,
                                       supine_patient_moved moved,
                                       const supine_patient_power *shape, supine_patient_power *fit,
                                       supine_error *error) {
  const size_t n = moved == SUPINE_PATIENT_STILL ? 1 : moved == SUPINE_PATIENT_TRANSLATION ? 4 : 7;
  double matrix[7 * 7] = {0.0};
  double right[7] = {0.0};
  for (size_t i = 0; i < count; ++i) {
    const supine_patient_row *row = &rows[i];
    double u[3];
    double x[7];
    supine_patient_power_displacement(shape, row, u);
    x[0] = row->axis[0] * u[0] + row->axis[1] * u[1] + row->axis[2] * u[2];
    memcpy(x + 1, row->axis, sizeof row->axis);
    for (size_t a = 0; a < 3; ++a) {
      x[4 + a] = row->axis[(a + 2) % 3] * row->place.arm[(a + 1) % 3] -
                 row->axis[(a + 1) % 3] * row->place.arm[(a + 2) % 3];
    }
    for (size_t a = 0; a < n; ++a) {
      for (size_t b = 0; b < n; ++b) {
        matrix[a * n + b] += row->weight * x[a] * x[b];
      }
      right[a] += row->weight * x[a] * row->value;
    }
  }
  const lapack_int size = (lapack_int)n;
  if (LAPACKE_dposv(LAPACK_COL_MAJOR, 'U', size, 1, matrix, size, right, size) != 0) {
    return supine_error_set(error, SUPINE_ERROR_NUMERICAL,
                            "the points do not determine the law: they may lie in one plane");
  }
  *fit = *shape;
  memset(fit->linear, 0, sizeof fit->linear);
  for (size_t a = 0; a < 3; ++a) {
    fit->linear[a] = right[0] * shape->linear[a];
  }
  memcpy(fit->linear + 3, right + 1, (n - 1) * sizeof *right);
  fit->squares = 0.0;
  for (size_t i = 0; i < count; ++i) {
    fit->squares += rows[i].weight * pow(supine_patient_power_residual(fit, &rows[i]), 2.0);
  }
  return SUPINE_OK;
}
