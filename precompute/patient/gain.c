/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The gain from a scan in another posture. */
#include <math.h>
#include <stdlib.h>

#include "precompute/patient/gain.h"

#include "precompute/patient/rows.h"

static const double gain_most = 2.0;
static const double same_posture = 0.05; /* of the unit vectors' distance: 3 degrees */
enum { SEARCH_STEPS = 40, GRID = 20 };

typedef struct problem {
  const supine_patient_record *record;
  const supine_patient_pairs *pairs;
  const double *gravity;
  bool moved;
  const supine_patient_row *rows; /* for their blocks */
  size_t without;                 /* block left out; SIZE_MAX: none */
} problem;

/* f of (18) at a point: heights over the corners of the frame. */
static double force_at(const supine_patient_frame *frame, const supine_force_law *law,
                       const double gravity[3], const double point[3]) {
  const supine_patient_place place = supine_patient_find(frame, point);
  double reach = 0.0;
  double height = 0.5;
  double force = law->base;
  for (int k = 0; k < 3; ++k) {
    reach += fabs(gravity[k]) * (frame->maximum[k] - frame->minimum[k]);
    force += law->box[k] * fmin(1.0, fmax(0.0, place.box[k]));
  }
  for (int k = 0; k < 3; ++k) {
    height += gravity[k] * place.arm[k] / reach;
  }
  return force + law->gain * height; /* (18) */
}

/* Squares left at a gain, mm^2, with the best scale and translation. */
static double squares_at(const problem *p, double gain, double *scale, double *count) {
  const supine_force_law law =
      supine_patient_force(&p->record->patient, gain, p->record->state.gravity);
  double sum[3][5] = {{0.0}}; /* by component: n, v, y, v v, v y */
  double yy = 0.0;
  for (size_t i = 0; i < p->pairs->count; ++i) {
    const double *from = p->pairs->from + 3 * i;
    double u[3];
    if (p->rows[3 * i].block == p->without) {
      continue;
    }
    supine_patient_displacement(&p->record->patient, from, u);
    const double then = force_at(&p->record->patient.frame, &law, p->record->state.gravity, from);
    const double now = force_at(&p->record->patient.frame, &law, p->gravity, from);
    for (size_t a = 0; a < 3; ++a) {
      const double v = then != 0.0 ? now / then * u[a] : 0.0;
      const double y = p->pairs->to[3 * i + a] - from[a];
      sum[a][0] += 1.0;
      sum[a][1] += v;
      sum[a][2] += y;
      sum[a][3] += v * v;
      sum[a][4] += v * y;
      yy += y * y;
    }
  }
  double vv = 0.0;
  double vy = 0.0;
  for (size_t a = 0; a < 3; ++a) {
    const double n = p->moved ? sum[a][0] : INFINITY; /* means taken off, or not */
    vv += sum[a][3] - sum[a][1] * sum[a][1] / n;
    vy += sum[a][4] - sum[a][1] * sum[a][2] / n;
    yy -= sum[a][2] * sum[a][2] / n;
  }
  *scale = vv > 0.0 ? vy / vv : 0.0;
  *count = sum[0][0];
  return fmax(0.0, yy - *scale * vy);
}

/* The best of a grid, then golden section between its neighbours. */
static double search(const problem *p, double *scale) {
  static const double golden = 0.6180339887498949;
  double count;
  double best = 0.0;
  double least = INFINITY;
  for (int i = 0; i <= GRID; ++i) {
    const double gain = gain_most * i / GRID;
    const double squares = squares_at(p, gain, scale, &count);
    if (squares < least) {
      least = squares;
      best = gain;
    }
  }
  double low = fmax(0.0, best - gain_most / GRID);
  double high = fmin(gain_most, best + gain_most / GRID);
  for (int i = 0; i < SEARCH_STEPS; ++i) {
    const double a = high - golden * (high - low);
    const double b = low + golden * (high - low);
    if (squares_at(p, a, scale, &count) < squares_at(p, b, scale, &count)) {
      high = b;
    } else {
      low = a;
    }
  }
  best = 0.5 * (low + high);
  (void)squares_at(p, best, scale, &count);
  return best;
}

supine_status supine_patient_gain_fit(const supine_patient_record *record,
                                      const supine_patient_pairs *pairs, const double gravity[3],
                                      bool moved, supine_patient_gain *found, supine_error *error) {
  double apart = 0.0;
  for (int k = 0; k < 3; ++k) {
    apart += pow(gravity[k] - record->state.gravity[k], 2.0);
  }
  if (sqrt(apart) < same_posture) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "the third scan's posture is the one that was fitted: it tells nothing "
                            "of what turns with gravity");
  }
  supine_patient_row *rows = malloc(3 * pairs->count * sizeof *rows);
  if (rows == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu landmarks",
                            pairs->count);
  }
  problem p = {record, pairs, gravity, moved, rows, SIZE_MAX};
  double count;
  double scale;
  supine_patient_rows_of_pairs(&record->patient.frame, pairs, rows);
  const size_t blocks =
      supine_patient_rows_block(&record->patient.frame, rows, 3 * pairs->count, 1);
  found->gain = search(&p, &found->scale);
  const double squares = squares_at(&p, found->gain, &scale, &count);
  found->left = sqrt(squares / count);
  found->left_without = sqrt(squares_at(&p, 0.0, &scale, &count) / count);
  double sum = 0.0;
  double square = 0.0;
  for (p.without = 0; p.without < blocks; ++p.without) {
    const double gain = search(&p, &scale);
    sum += gain;
    square += gain * gain;
  }
  const double b = (double)blocks;
  found->error = sqrt(fmax(0.0, (b - 1.0) / b * (square - sum * sum / b)));
  free(rows);
  return SUPINE_OK;
}
