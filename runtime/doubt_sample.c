/* SPDX-License-Identifier: MIT */
/* Draw lungs from the random field of the expected error, by random Fourier features of its kernel
 * (Rahimi & Recht 2007): Matern's kernel of order 3/2 is the mean of cos(w (p - q)) over
 * frequencies w that follow Student's t distribution with 3 degrees of freedom / 90 mm. */
#include <math.h>
#include <string.h>

#include "runtime/doubt.h"
#include "runtime/internal.h"
#include "runtime/rigid.h"

enum { FEATURES = 32, AXES = 3 };

/* A random field with the variance 1 on each axis: the sum of amplitude [0] cos(w p) + amplitude
 * [1] sin(w p) / sqrt(FEATURES). */
typedef struct wave {
  double frequency[AXES]; /* rad/mm */
  double amplitude[2][AXES];
} wave;

/* A stream of pseudo-random numbers: the state of SplitMix64 (Steele et al. 2014). */
static double next_uniform(uint64_t *state) {
  uint64_t z = *state += UINT64_C(0x9E3779B97F4A7C15);
  z = (z ^ z >> 30) * UINT64_C(0xBF58476D1CE4E5B9);
  z = (z ^ z >> 27) * UINT64_C(0x94D049BB133111EB);
  return ((double)((z ^ z >> 31) >> 11) + 0.5) * 0x1p-53;
}

static double next_normal(uint64_t *state) {
  const double radius = sqrt(-2 * log(next_uniform(state)));
  return radius * cos(6.283185307179586 * next_uniform(state));
}

/* Begin the stream of one part of a sample. */
static uint64_t begin_stream(uint64_t seed, uint64_t index, uint64_t part) {
  uint64_t state =
      seed ^ index * UINT64_C(0xD1342543DE82EF95) ^ (part + 1) * UINT64_C(0xAEF17502108EF2D9);
  (void)next_uniform(&state);
  return state;
}

static void draw(uint64_t seed, size_t index, size_t part, wave waves[FEATURES]) {
  uint64_t state = begin_stream(seed, index, part);
  for (size_t m = 0; m < FEATURES; ++m) {
    double square = 0; /* chi-squared with 3 degrees of freedom */
    for (int k = 0; k < 3; ++k) {
      const double normal = next_normal(&state);
      square += normal * normal;
    }
    const double scale = sqrt(3 / fmax(square, 1e-12)) / supine_kriging_default.length;
    for (size_t k = 0; k < AXES; ++k) {
      waves[m].frequency[k] = scale * next_normal(&state);
    }
    for (size_t k = 0; k < 2 * AXES; ++k) {
      waves[m].amplitude[k / AXES][k % AXES] = next_normal(&state);
    }
  }
}

/* Add `factor` times a field to `error` [3] at a position. */
static void add_waves(const wave waves[FEATURES], double factor, const double place[3],
                      double error[3]) {
  const double unit = factor / sqrt((double)FEATURES);
  for (size_t m = 0; m < FEATURES; ++m) {
    const wave *w = &waves[m];
    const double phase =
        w->frequency[0] * place[0] + w->frequency[1] * place[1] + w->frequency[2] * place[2];
    const double c = unit * cos(phase);
    const double s = unit * sin(phase);
    for (size_t k = 0; k < AXES; ++k) {
      error[k] += w->amplitude[0][k] * c + w->amplitude[1][k] * s;
    }
  }
}

/* Two fields, one common to all lungs with the share 1/3 of the variance, and that of one lung. */
typedef struct pair {
  wave common[FEATURES], own[FEATURES];
} pair;

static void draw_pair(uint64_t seed, size_t index, size_t part, size_t lung, pair *p) {
  draw(seed, index, part * (SUPINE_LUNGS_MAX + 1), p->common);
  draw(seed, index, part * (SUPINE_LUNGS_MAX + 1) + 1 + lung, p->own);
}

static void add_pair(const pair *p, double factor, const double place[3], double error[3]) {
  const double across = supine_kriging_default.across;
  add_waves(p->common, factor * sqrt(across), place, error);
  add_waves(p->own, factor * sqrt(1 - across), place, error);
}

/* Add the errors of one part, a component of the states or another day, to the vertices of a lung.
 */
static void add_part(const supine_doubt *d, const supine_doubt_features *features, size_t count,
                     size_t part, const pair *p, float *xyz) {
  const double day = sqrt(supine_doubt_day_square(d));
  for (size_t i = 0; i < count; ++i) {
    const supine_doubt_features *f = &features[i];
    const double factor = part == d->state_count ? day : f->deviation * d->root[f->state][part];
    double error[3] = {0};
    add_pair(p, factor, f->place, error);
    for (size_t k = 0; k < 3; ++k) {
      xyz[3 * i + k] += (float)error[k];
    }
  }
}

supine_status supine_doubt_sample(const supine_doubt *doubt, size_t state, uint64_t seed,
                                  size_t index, float *xyz, supine_error *error) {
  const supine_basis_info *info = supine_basis_get_info(doubt->basis);
  supine_doubt_features features[LOCATE_BLOCK];
  double factor[DOUBT_VECTORS]; /* of assumed volume, heart, sliding and collapse */
  if (state >= doubt->state_count) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT, "state %zu: give one below %zu", state,
                            doubt->state_count);
  }
  uint64_t stream = begin_stream(seed, index, UINT64_MAX - 1);
  for (size_t v = 0; v < DOUBT_VECTORS; ++v) {
    factor[v] = next_normal(&stream);
  }
  const size_t parts = doubt->state_count + (doubt->another_day ? 1 : 0);
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    const size_t end = info->lung_begin[lung + 1];
    for (size_t part = 0; part <= parts; ++part) { /* the last: positions and vectors */
      pair p;
      if (part < parts) {
        draw_pair(seed, index, part, lung, &p);
      }
      for (size_t at = info->lung_begin[lung]; at < end; at += LOCATE_BLOCK) {
        const size_t count = end - at < LOCATE_BLOCK ? end - at : LOCATE_BLOCK;
        supine_doubt_evaluate(doubt, state, at, at + count, features);
        if (part == 0) {
          memset(xyz + 3 * at, 0, 3 * count * sizeof *xyz);
        }
        if (part < parts) {
          add_part(doubt, features, count, part, &p, xyz + 3 * at);
          continue;
        }
        for (size_t e = 0; e < 3 * count; ++e) {
          const supine_doubt_features *f = &features[e / 3];
          double sum = f->at[e % 3];
          for (size_t v = 0; v < DOUBT_VECTORS; ++v) {
            sum += factor[v] * f->vector[v][e % 3];
          }
          xyz[3 * at + e] += (float)sum;
        }
      }
    }
  }
  supine_rigid_restore(doubt->basis, xyz);
  return SUPINE_OK;
}
