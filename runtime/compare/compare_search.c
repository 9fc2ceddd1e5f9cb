/* SPDX-License-Identifier: MIT */
/* Search the sphere for the directions of gravity that differ most. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sh/base/vec3.h"

#include "runtime/compare/compare_internal.h"

static const double last_step = 1e-6; /* rad */

enum {
  DIRECTIONS_MAX = 16384,
  MOVES_MAX = 4096,
  STATE_MAX = 3 * SUPINE_LUNGS_MAX * SUPINE_MODES_MAX
};

typedef struct search {
  const supine_compare *compare;
  const supine_state *from; /* posture to compare with, and volume of all states */
  double rms;               /* mm, or 0 */
  size_t count;             /* 3 G K */
  size_t reached;           /* number of directions that reach the volume */
  double (*direction)[3];   /* [reached] */
  double *state;            /* [reached, 3 G K] q = gains x weights */
  double *product;          /* [reached, 3 G K] G q */
  double *square;           /* [reached] q^T G q */
} search;

static supine_status state_of(const search *s, const double direction[3], double *q,
                              supine_error *error) {
  supine_pose pose;
  supine_state state = *s->from;
  memcpy(state.gravity, direction, sizeof state.gravity);
  const supine_status status = supine_compare_pose(s->compare, &state, s->rms, &pose, error);
  if (status == SUPINE_OK) {
    supine_compare_state(s->compare, &pose, NULL, q);
  }
  return status;
}

/* Compute the squared distance of two states, mm^2, from their difference, which avoids
 * cancellation if they are near. */
static double apart(const search *s, const double *a, const double *b) {
  double q[STATE_MAX];
  for (size_t k = 0; k < s->count; ++k) {
    q[k] = a[k] - b[k];
  }
  return supine_compare_square(s->compare, q);
}

/* Compute the product G q, matrix by matrix. */
static void multiply(const search *s, const double *q, double *product) {
  const size_t modes = s->compare->basis->info.mode_count;
  for (size_t row = 0; row < s->count; ++row) {
    const size_t begin = row / modes * modes;
    product[row] = 0;
    for (size_t l = 0; l < modes; ++l) {
      product[row] += s->compare->gram[row * modes + l] * q[begin + l];
    }
  }
}

/* Compute the states of the spiral's directions that reach the volume, and last that of `from`. */
static supine_status sample(search *s, const double from[3], size_t directions,
                            supine_error *error) {
  supine_status status = SUPINE_OK;
  for (size_t i = 0; i <= directions; ++i) {
    double *q = s->state + s->reached * s->count;
    if (i < directions) {
      supine_spiral((double)i, (double)directions, 0, s->direction[s->reached]);
    } else {
      memcpy(s->direction[s->reached], from, sizeof s->direction[0]);
    }
    status = state_of(s, s->direction[s->reached], q, error);
    if (status == SUPINE_ERROR_NUMERICAL && i < directions) {
      continue;
    }
    if (status != SUPINE_OK) {
      return status;
    }
    double *product = s->product + s->reached * s->count;
    double square = 0;
    multiply(s, q, product);
    for (size_t k = 0; k < s->count; ++k) {
      square += q[k] * product[k];
    }
    s->square[s->reached++] = square;
  }
  return s->reached >= 2 ? SUPINE_OK
                         : supine_error_set(error, SUPINE_ERROR_NUMERICAL,
                                            "no other direction of gravity reaches this volume: "
                                            "give another volume");
}

/* Compute the squared distance of sampled states i and j, mm^2, from stored products. */
static double sampled_apart(const search *s, size_t i, size_t j) {
  const double *product = s->product + i * s->count;
  const double *q = s->state + j * s->count;
  double both = 0;
  for (size_t k = 0; k < s->count; ++k) {
    both += product[k] * q[k];
  }
  return s->square[i] - 2 * both + s->square[j];
}

/* Turn `direction` by `step` radians along axis `move` / 2 of its tangent plane, forwards if `move`
 * is even, else backwards. */
static void turned(const double direction[3], int move, double step, double result[3]) {
  const int thin = fabs(direction[0]) < 0.6 ? 0 : (fabs(direction[1]) < 0.6 ? 1 : 2);
  double across[3] = {0, 0, 0};
  across[thin] = 1;
  double t[3];
  supine_cross(direction, across, t);
  (void)supine_normalise(t, t);
  if (move / 2 == 1) {
    double u[3];
    supine_cross(direction, t, u);
    memcpy(t, u, sizeof u);
  }
  const double sign = move % 2 == 0 ? 1 : -1;
  for (int axis = 0; axis < 3; ++axis) {
    result[axis] = cos(step) * direction[axis] + sign * sin(step) * t[axis];
  }
  (void)supine_normalise(result, result);
}

/* Move the first `movable` of two directions while that increases the distance of their states;
 * return that distance, mm. */
static double refine(const search *s, double direction[2][3], int movable, double step) {
  double q[2][STATE_MAX];
  (void)state_of(s, direction[0], q[0], NULL); /* both reached the volume before */
  (void)state_of(s, direction[1], q[1], NULL);
  double best = apart(s, q[0], q[1]);
  for (int moves = 0; moves < MOVES_MAX && step > last_step;) {
    bool better = false;
    for (int which = 0; which < movable; ++which) {
      for (int move = 0; move < 4; ++move, ++moves) {
        double tried[3];
        double state[STATE_MAX];
        turned(direction[which], move, step, tried);
        if (state_of(s, tried, state, NULL) != SUPINE_OK) {
          continue;
        }
        const double distance = apart(s, state, q[1 - which]);
        if (distance > best) {
          best = distance;
          better = true;
          memcpy(direction[which], tried, sizeof tried);
          memcpy(q[which], state, s->count * sizeof *state);
        }
      }
    }
    step = better ? step : step / 2;
  }
  return sqrt(fmax(best, 0));
}

static void find(const search *s, size_t directions, supine_extremes *extremes) {
  const double spacing = 3.5449 / sqrt((double)directions); /* sqrt(4 pi / directions) */
  const size_t from = s->reached - 1;
  size_t pair[2] = {0, from};
  size_t farthest = 0;
  double pair_square = -1;
  double farthest_square = -1;
  for (size_t i = 0; i < s->reached; ++i) {
    for (size_t j = i + 1; j < s->reached; ++j) {
      const double square = sampled_apart(s, i, j);
      if (square > pair_square) {
        pair_square = square;
        pair[0] = i;
        pair[1] = j;
      }
      if (j == from && square > farthest_square) {
        farthest_square = square;
        farthest = i;
      }
    }
  }
  double moving[2][3];
  memcpy(moving[0], s->direction[pair[0]], sizeof moving[0]);
  memcpy(moving[1], s->direction[pair[1]], sizeof moving[1]);
  extremes->pair_rms = refine(s, moving, 2, spacing);
  memcpy(extremes->pair, moving, sizeof moving);
  memcpy(moving[0], s->direction[farthest], sizeof moving[0]);
  memcpy(moving[1], s->direction[from], sizeof moving[1]);
  extremes->farthest_rms = refine(s, moving, 1, spacing);
  memcpy(extremes->farthest, moving[0], sizeof moving[0]);
  extremes->directions = s->reached - 1;
}

supine_status supine_compare_search(const supine_compare *compare, const supine_state *from,
                                    double rms, size_t directions, supine_extremes *extremes,
                                    supine_error *error) {
  if (directions < 2 || directions > DIRECTIONS_MAX) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT, "%zu directions: give 2 to %d",
                            directions, (int)DIRECTIONS_MAX);
  }
  double start[3];
  if (!supine_normalise(from->gravity, start)) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT, "gravity has no direction");
  }
  search s = {.compare = compare,
              .from = from,
              .rms = rms,
              .count = 3 * compare->basis->info.lung_count * compare->basis->info.mode_count};
  const size_t n = directions + 1;
  s.direction = calloc(n, sizeof *s.direction);
  s.state = calloc(n * s.count, sizeof *s.state);
  s.product = calloc(n * s.count, sizeof *s.product);
  s.square = calloc(n, sizeof *s.square);
  supine_status status = SUPINE_ERROR_MEMORY;
  if (s.direction == NULL || s.state == NULL || s.product == NULL || s.square == NULL) {
    (void)supine_error_set(error, status, "out of memory");
    goto cleanup;
  }
  status = sample(&s, start, directions, error);
  if (status == SUPINE_OK) {
    find(&s, directions, extremes);
  }
cleanup:
  free(s.direction);
  free(s.state);
  free(s.product);
  free(s.square);
  return status;
}
