/* SPDX-License-Identifier: MIT */
/* Predict residuals and their variance at many points, RUN points at a time. */
#include <math.h>
#include <string.h>

#include "runtime/kriging.h"

enum { RUN = 32, COLUMNS = SUPINE_KRIGING_TERMS };

/* RUN consecutive points at which to predict. If fewer are left, the last one is repeated. */
typedef struct run {
  float place[3][RUN];  /* [axis][point] position minus supine_kriging.centre, mm */
  float volume[3][RUN]; /* [axis][point] shift per prior standard deviation of the volume, mm */
  float root[RUN];      /* [point] standard deviation of each coordinate of the random field, mm */
} run;

static void fill(const supine_kriging *fit, const supine_kriging_target *target, size_t begin,
                 run *out) {
  const float least = (float)fit->model.least;
  const float sill = (float)(fit->model.sill / 3);
  for (size_t v = 0; v < RUN; ++v) {
    const size_t at = begin + v < target->count ? begin + v : target->count - 1;
    const float size = target->size[at];
    out->root[v] = sqrtf(sill * (size > least ? size : least));
    for (size_t i = 0; i < 3; ++i) {
      out->place[i][v] = target->position[3 * at + i] - (float)fit->centre[i];
      out->volume[i][v] = target->volume == NULL ? 0 : target->volume[3 * at + i];
    }
  }
}

/* Compute the covariances, mm^2, of one coordinate of the random field between observed point j and
 * each of RUN points. The exponential function of the distance is computed as the 64th power of a
 * polynomial of degree 5; the relative error is 1e-6. */
static void covary(const supine_kriging *fit, size_t j, size_t lung, const run *in, float *out) {
  const supine_kriging_point *p = &fit->points[j];
  const double size = p->size > fit->model.least ? p->size : fit->model.least;
  const float root =
      (float)(sqrt(fit->model.sill / 3 * size) * (p->lung == lung ? 1.0 : fit->model.across));
  const float rate = (float)(sqrt(3.0) / fit->model.length);
  const float x = (float)(p->position[0] - fit->centre[0]);
  const float y = (float)(p->position[1] - fit->centre[1]);
  const float z = (float)(p->position[2] - fit->centre[2]);
  for (size_t v = 0; v < RUN; ++v) {
    const float dx = in->place[0][v] - x;
    const float dy = in->place[1][v] - y;
    const float dz = in->place[2][v] - z;
    const float far = rate * sqrtf(dx * dx + dy * dy + dz * dz);
    const float a = far < 40.0F ? far : 40.0F;
    const float t = a * (-1.0F / 64);
    float e = 1 + t * (1 + t * (0.5F + t * (1 / 6.0F + t * (1 / 24.0F + t * (1 / 120.0F)))));
    for (int square = 0; square < 6; ++square) {
      e *= e;
    }
    out[v] = root * in->root[v] * (1 + a) * e;
  }
}

/* Compute the sum over j < count of numbers[j] w[j][v] for each point v of RUN points. */
static void project(size_t count, float (*w)[RUN], const double *numbers, float *sum) {
  memset(sum, 0, RUN * sizeof *sum);
  for (size_t j = 0; j < count; ++j) {
    const float number = (float)numbers[j];
    for (size_t v = 0; v < RUN; ++v) {
      sum[v] += number * w[j][v];
    }
  }
}

/* For each of RUN points, solve L w = k. L is the Cholesky factor of the covariance matrix of the
 * observed points. k holds the covariances between this point and the observed points. */
static void solve(const supine_kriging *fit, size_t lung, const run *in, float (*w)[RUN]) {
  const size_t n = fit->count;
  for (size_t j = 0; j < n; ++j) {
    const double *row = fit->factor + j * n;
    const float inverse = (float)(1 / row[j]);
    float sum[RUN];
    covary(fit, j, lung, in, sum);
    for (size_t k = 0; k < j; ++k) {
      const float number = (float)row[k];
      for (size_t v = 0; v < RUN; ++v) {
        sum[v] -= number * w[k][v];
      }
    }
    for (size_t v = 0; v < RUN; ++v) {
      w[j][v] = inverse * sum[v];
    }
  }
}

/* Add what the fitted terms and the positions along lines leave to the variances. */
static void vary_lines(const supine_kriging *fit, float (*column)[RUN], float (*w)[RUN],
                       float *variance) {
  for (size_t v = 0; v < RUN; ++v) {
    double weights[SUPINE_KRIGING_POINTS_MAX];
    double row[COLUMNS];
    for (size_t j = 0; j < fit->count; ++j) {
      weights[j] = (double)w[j][v];
    }
    for (size_t c = 0; c < COLUMNS; ++c) {
      row[c] = (double)column[c][v];
    }
    variance[v] += (float)supine_kriging_line_variance(fit, row, weights);
  }
}

/* Compute the variance of the prediction, summed over x, y and z, at each of RUN points, mm^2:
 *
 *     3 (k - w'w) + m' S m        m = h - sum over j of w_j h_j
 *
 *     k    variance of one coordinate of the random field
 *     w_j  L^-1 times the covariances with the observed points j (solve)
 *     S    covariance of the fitted terms (supine_kriging.spread)
 *     h    seven numbers of this point: 1, shift by the volume [3], position - centre [3]
 *     h_j  the same numbers of observed point j, times L^-1 (supine_kriging.whitened)
 *
 * With lines, supine_kriging_line_variance replaces m' S m. */
static void vary(const supine_kriging *fit, const run *in, float (*w)[RUN], float *variance) {
  float column[COLUMNS][RUN];
  for (size_t v = 0; v < RUN; ++v) {
    variance[v] = in->root[v] * in->root[v];
  }
  for (size_t j = 0; j < fit->count; ++j) {
    for (size_t v = 0; v < RUN; ++v) {
      variance[v] -= w[j][v] * w[j][v];
    }
  }
  for (size_t v = 0; v < RUN; ++v) {
    variance[v] = 3 * (variance[v] > 0 ? variance[v] : 0);
  }
  for (size_t c = 0; c < COLUMNS; ++c) {
    if (fit->spread[c][c] == 0) {
      memset(column[c], 0, sizeof column[c]);
      continue;
    }
    project(fit->count, w, fit->whitened + c * fit->count, column[c]);
    if (c == 0) {
      for (size_t v = 0; v < RUN; ++v) {
        column[c][v] = 1 - column[c][v];
      }
    } else {
      const float *here = c < 4 ? in->volume[c - 1] : in->place[c - 4];
      for (size_t v = 0; v < RUN; ++v) {
        column[c][v] = here[v] - column[c][v];
      }
    }
    for (size_t d = 0; d <= c; ++d) {
      const float number = (float)((d < c ? 2 : 1) * fit->spread[c][d]);
      if (fit->spread[d][d] != 0 && fit->lines == NULL) {
        for (size_t v = 0; v < RUN; ++v) {
          variance[v] += number * column[c][v] * column[d][v];
        }
      }
    }
  }
  if (fit->lines != NULL) {
    vary_lines(fit, column, w, variance);
  }
}

void supine_kriging_predict(const supine_kriging *fit, const supine_kriging_target *target,
                            float *shift, float *variance) {
  float w[SUPINE_KRIGING_POINTS_MAX][RUN];
  float sum[RUN];
  run in;
  for (size_t begin = 0; begin < target->count; begin += RUN) {
    const size_t count = target->count - begin < RUN ? target->count - begin : RUN;
    fill(fit, target, begin, &in);
    solve(fit, target->lung, &in, w);
    vary(fit, &in, w, sum);
    memcpy(variance + begin, sum, count * sizeof *sum);
    for (size_t i = 0; i < 3; ++i) {
      project(fit->count, w, fit->weights + i * fit->count, sum);
      const float *turn = in.place[(i + 2) % 3];
      const float *other = in.place[(i + 1) % 3];
      for (size_t v = 0; v < count; ++v) {
        shift[3 * (begin + v) + i] = sum[v] + (float)fit->terms[i] +
                                     (float)fit->terms[3] * in.volume[i][v] +
                                     (float)fit->terms[4 + (i + 1) % 3] * turn[v] -
                                     (float)fit->terms[4 + (i + 2) % 3] * other[v];
      }
    }
  }
}
