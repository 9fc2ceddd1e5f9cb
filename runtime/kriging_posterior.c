/* SPDX-License-Identifier: MIT */
/* What observed points leave of a random field: its covariance at two places, and the prediction of
 * other residuals of the same points. */
#include <math.h>
#include <string.h>

#include "base/vec3.h"
#include "runtime/kriging.h"

enum { ONE = 0, VOLUME = 1, PLACE = 4, TERMS = SUPINE_KRIGING_TERMS };

/* Variance of a landmark of a fit, as a share of that of the field: about 2 mm on each axis where
 * the field has 6 mm. */
static const double noise_share = 0.1;

void supine_kriging_whiten(const supine_kriging *fit, const supine_kriging_point *at, double *w) {
  for (size_t j = 0; j < fit->count; ++j) {
    const supine_kriging_point *p = &fit->points[j];
    w[j] = supine_kriging_covariance(&fit->model, p->position, p->size, at->position, at->size,
                                     p->lung == at->lung);
  }
  supine_kriging_forward(fit->count, fit->factor, w);
}

/* What a prediction lacks of the fitted terms and of the positions along lines. */
typedef struct unknown {
  double terms[3][TERMS];                      /* of each axis, by each term */
  double along[3 * SUPINE_KRIGING_POINTS_MAX]; /* [3, count] of each axis, by each line */
} unknown;

static void find_unknown(const supine_kriging *fit, const supine_kriging_point *at, const double *w,
                         unknown *left) {
  const size_t n = fit->count;
  double row[PLACE + 3];
  row[ONE] = 1;
  for (size_t k = 0; k < 3; ++k) {
    row[VOLUME + k] = at->volume[k];
    row[PLACE + k] = at->position[k] - fit->centre[k];
  }
  if (fit->lines != NULL) {
    double weights[SUPINE_KRIGING_POINTS_MAX];
    memcpy(weights, w, n * sizeof *w);
    supine_kriging_backward(n, fit->factor, weights);
    supine_kriging_project_lines(fit, weights, left->along);
  }
  for (size_t e = 0; e < 3 * TERMS; ++e) {
    const size_t axis = e / TERMS;
    const size_t k = e % TERMS;
    double sign = 0;
    const size_t column = (size_t)supine_kriging_column(k, axis, &sign);
    left->terms[axis][k] = sign * (row[column] - supine_dot_n(n, w, fit->whitened + column * n));
    if (fit->lines != NULL) {
      left->terms[axis][k] += supine_dot_n(n, left->along + axis * n, fit->along + k * n);
    }
  }
}

void supine_kriging_covary(const supine_kriging *fit, const supine_kriging_point *a,
                           const double *a_white, const supine_kriging_point *b,
                           const double *b_white, double covariance[9]) {
  const size_t n = fit->count;
  const double field = supine_kriging_covariance(&fit->model, a->position, a->size, b->position,
                                                 b->size, a->lung == b->lung) -
                       supine_dot_n(n, a_white, b_white);
  unknown left[2];
  if (fit->has_terms) {
    find_unknown(fit, a, a_white, &left[0]);
    find_unknown(fit, b, b_white, &left[1]);
  }
  for (size_t e = 0; e < 9; ++e) {
    const size_t row = e / 3;
    const size_t column = e % 3;
    covariance[e] = row == column ? field : 0;
    if (fit->has_terms) {
      for (size_t k = 0; k < TERMS; ++k) {
        covariance[e] +=
            left[0].terms[row][k] * supine_dot_n(TERMS, fit->covariance[k], left[1].terms[column]);
      }
    }
    if (fit->lines != NULL) {
      covariance[e] += supine_dot_n(n, left[0].along + row * n, left[1].along + column * n);
    }
  }
}

void supine_kriging_move(const supine_kriging *fit, const double terms[TERMS],
                         const supine_kriging_point *at, double moved[3]) {
  for (size_t k = 0; k < 3; ++k) {
    const size_t i = (k + 1) % 3;
    const size_t j = (k + 2) % 3;
    moved[k] = terms[k] + terms[3] * at->volume[k] +
               terms[4 + i] * (at->position[j] - fit->centre[j]) -
               terms[4 + j] * (at->position[i] - fit->centre[i]);
  }
}

void supine_kriging_refit(const supine_kriging *fit, double *residuals, double terms[TERMS]) {
  const size_t n = fit->count;
  double along[SUPINE_KRIGING_POINTS_MAX] = {0}; /* how far along its line each point lies */
  double right[TERMS] = {0};
  memset(terms, 0, TERMS * sizeof *terms);
  for (size_t axis = 0; axis < 3; ++axis) {
    supine_kriging_forward(n, fit->factor, residuals + axis * n);
  }
  if (fit->has_terms) {
    if (fit->lines != NULL) {
      supine_kriging_see_lines(fit, residuals, along);
    }
    for (size_t k = 0; k < TERMS; ++k) {
      for (size_t axis = 0; axis < 3; ++axis) {
        double sign = 0;
        const double *x = fit->whitened + (size_t)supine_kriging_column(k, axis, &sign) * n;
        right[k] += sign * supine_dot_n(n, x, residuals + axis * n);
      }
      right[k] -= fit->lines != NULL ? supine_dot_n(n, fit->along + k * n, along) : 0;
    }
    for (size_t k = 0; k < TERMS; ++k) {
      terms[k] = supine_dot_n(TERMS, fit->covariance[k], right);
    }
    supine_kriging_subtract_terms(fit, terms, along, residuals);
  }
  for (size_t axis = 0; axis < 3; ++axis) {
    supine_kriging_backward(n, fit->factor, residuals + axis * n);
  }
}

void supine_kriging_shift(const supine_kriging *fit, const double *weights,
                          const double terms[TERMS], const supine_kriging_point *at,
                          double shift[3]) {
  supine_kriging_move(fit, terms, at, shift);
  for (size_t j = 0; j < fit->count; ++j) {
    const supine_kriging_point *p = &fit->points[j];
    const double c = supine_kriging_covariance(&fit->model, p->position, p->size, at->position,
                                               at->size, p->lung == at->lung);
    for (size_t axis = 0; axis < 3; ++axis) {
      shift[axis] += c * weights[axis * fit->count + j];
    }
  }
}

supine_kriging_point supine_kriging_landmark(const double position[3], size_t lung) {
  return (supine_kriging_point){.position = {position[0], position[1], position[2]},
                                .size = 1,
                                .noise = sqrt(noise_share),
                                .lung = lung};
}

supine_status supine_kriging_fit_landmarks(size_t count, const supine_kriging_point *landmarks,
                                           double *space, supine_kriging *fit,
                                           supine_error *error) {
  supine_kriging_options unit = {.model = supine_kriging_default, .field_only = true};
  unit.model.sill = 3; /* so that a size of 1 has the variance 1 on each axis */
  unit.model.least = 0;
  return supine_kriging_fit(&unit, count, landmarks, space, fit, error);
}

double supine_kriging_share(const supine_kriging *fit, const supine_kriging_point *at,
                            double *scratch) {
  supine_kriging_whiten(fit, at, scratch);
  return fmax(0, 1 - supine_dot_n(fit->count, scratch, scratch));
}
