/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Affine and quadratic laws: linear least squares with a ridge. */
#include <math.h>
#include <string.h>

#include <lapacke.h>

#include "precompute/patient/rows.h"

enum { N = SUPINE_PATIENT_POLYNOMIAL, TERMS = SUPINE_PATIENT_TERMS, LINEAR_TERMS = 4 };

/* Beside each coefficient's own square: enough to solve where data leave one open. */
static const double slightest_ridge = 1e-9;

static size_t shared_term(size_t component, size_t term) {
  return 2 * component * TERMS + term;
}

static size_t lung_term(size_t component, size_t term) {
  return (2 * component + 1) * TERMS + term;
}

void supine_patient_normals_add_row(supine_patient_normals *normals,
                                    const supine_patient_row *row) {
  double terms[TERMS];
  double design[N];
  supine_patient_terms(row->place.box, terms, NULL);
  for (size_t a = 0; a < 3; ++a) {
    const double sign = row->axis[a] * (a == 0 ? row->place.side : 1.0);
    for (size_t j = 0; j < TERMS; ++j) {
      design[shared_term(a, j)] = sign * terms[j];
      design[lung_term(a, j)] = sign * row->place.side * terms[j];
    }
  }
  for (size_t i = 0; i < N; ++i) {
    const double weighted = row->weight * design[i];
    for (size_t j = 0; j <= i && weighted != 0.0; ++j) {
      normals->matrix[i][j] += weighted * design[j]; /* lower triangle */
    }
    normals->right[i] += weighted * row->value;
  }
  normals->squares += row->weight * row->value * row->value;
  normals->weight += row->weight;
}

void supine_patient_normals_add(supine_patient_normals *normals,
                                const supine_patient_normals *other) {
  for (size_t i = 0; i < N; ++i) {
    for (size_t j = 0; j <= i; ++j) {
      normals->matrix[i][j] += other->matrix[i][j];
    }
    normals->right[i] += other->right[i];
  }
  normals->squares += other->squares;
  normals->weight += other->weight;
}

static void leave_all_out(double penalty[N]) {
  for (size_t i = 0; i < N; ++i) {
    penalty[i] = INFINITY;
  }
}

/* In mirrored coordinates a translation, and an affine map of both lungs together, are partly the
 * same in both lungs and partly of opposite sign. */
void supine_patient_penalty_translation(double penalty[N]) {
  leave_all_out(penalty);
  penalty[lung_term(0, 0)] = 0.0;
  penalty[shared_term(1, 0)] = 0.0;
  penalty[shared_term(2, 0)] = 0.0;
}

void supine_patient_penalty_affine(bool by_lung, double penalty[N]) {
  leave_all_out(penalty);
  for (size_t a = 0; a < 3; ++a) {
    for (size_t j = 0; j < LINEAR_TERMS; ++j) {
      const bool shared = (a == 0) == (j == 1);
      if (by_lung || shared) {
        penalty[shared_term(a, j)] = 0.0;
      }
      if (by_lung || !shared) {
        penalty[lung_term(a, j)] = 0.0;
      }
    }
  }
}

void supine_patient_penalty_quadratic(double quadratic, double lung, bool one_lung,
                                      double penalty[N]) {
  supine_patient_penalty_affine(false, penalty);
  for (size_t a = 0; a < 3; ++a) {
    for (size_t j = 0; j < TERMS; ++j) {
      if (j >= LINEAR_TERMS || penalty[shared_term(a, j)] > 0.0) {
        penalty[shared_term(a, j)] = j >= LINEAR_TERMS ? quadratic : 0.0;
      }
      if (one_lung) {
        penalty[lung_term(a, j)] = INFINITY;
        penalty[shared_term(a, j)] = j >= LINEAR_TERMS ? quadratic : 0.0;
      } else if (j >= LINEAR_TERMS) {
        penalty[lung_term(a, j)] = fmax(quadratic, lung);
      } else if (penalty[lung_term(a, j)] > 0.0) {
        penalty[lung_term(a, j)] = lung;
      }
    }
  }
}

supine_status supine_patient_polynomial_fit(const supine_patient_normals *normals,
                                            const double penalty[N], double coefficients[N]) {
  double matrix[N * N];
  double trace = 0.0;
  for (size_t i = 0; i < N; ++i) {
    trace += normals->matrix[i][i] / N;
  }
  memcpy(matrix, normals->matrix, sizeof matrix);
  memcpy(coefficients, normals->right, N * sizeof *coefficients);
  for (size_t i = 0; i < N; ++i) {
    for (size_t j = 0; j < i; ++j) {
      if (isinf(penalty[i]) || isinf(penalty[j])) {
        matrix[i * N + j] = 0.0;
      }
    }
    if (isinf(penalty[i])) {
      matrix[i * N + i] = 1.0;
      coefficients[i] = 0.0;
    } else {
      matrix[i * N + i] += penalty[i] + slightest_ridge * trace;
    }
  }
  return LAPACKE_dposv(LAPACK_COL_MAJOR, 'U', N, 1, matrix, N, coefficients, N) == 0
             ? SUPINE_OK
             : SUPINE_ERROR_NUMERICAL;
}

double supine_patient_polynomial_squares(const supine_patient_normals *normals, const double c[N]) {
  double squares = normals->squares;
  for (size_t i = 0; i < N; ++i) {
    double product = normals->matrix[i][i] * c[i];
    for (size_t j = 0; j < i; ++j) { /* both triangles */
      product += 2.0 * normals->matrix[i][j] * c[j];
    }
    squares += c[i] * (product - 2.0 * normals->right[i]);
  }
  return fmax(0.0, squares);
}
