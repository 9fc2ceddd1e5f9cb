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

/* What the observed points would predict of a random field. */
typedef struct prediction {
  double weights[AXES * SUPINE_KRIGING_LANDMARKS_MAX];
  double terms[SUPINE_KRIGING_TERMS]; /* fitted minus drawn */
} prediction;

/* Draw the terms of located lungs: volume, rotation, and how far away they are. */
static void draw_terms(const supine_kriging_options *options, uint64_t *stream,
                       double terms[SUPINE_KRIGING_TERMS]) {
  const double far = options->axis_deviation * next_normal(stream);
  for (size_t k = 0; k < AXES; ++k) {
    terms[k] = far * options->axis[k];
    terms[4 + k] = options->rotation ? options->rotation_deviation * next_normal(stream) : 0;
  }
  terms[3] = options->volume ? next_normal(stream) : 0;
}

/* Draw what is seen of a field at the observed points, with noise, and find what it predicts. */
static void see(const supine_doubt *d, uint64_t seed, size_t index, size_t part,
                prediction *found) {
  const supine_kriging *seen = d->seen;
  const size_t lungs = supine_basis_get_info(d->basis)->lung_count;
  double drawn[SUPINE_KRIGING_TERMS] = {0};
  uint64_t stream = begin_stream(seed, index, UINT64_MAX - 2 - part);
  if (d->location != NULL) {
    draw_terms(&d->location->options, &stream, drawn);
  }
  for (size_t lung = 0; lung <= lungs; ++lung) { /* the last: landmarks in no lung of the basis */
    pair p;
    draw_pair(seed, index, part, lung, &p);
    for (size_t j = 0; j < seen->count; ++j) {
      const supine_kriging_point *point = &seen->points[j];
      double moved[AXES];
      double error[AXES] = {0};
      if (point->lung < lungs ? point->lung != lung : lung != lungs) {
        continue;
      }
      supine_kriging_move(seen, drawn, point, moved);
      add_pair(&p, supine_kriging_deviation(&seen->model, point->size), point->position, error);
      for (size_t k = 0; k < AXES; ++k) {
        found->weights[k * seen->count + j] =
            error[k] + moved[k] + point->noise * next_normal(&stream);
      }
    }
  }
  supine_kriging_refit(seen, found->weights, found->terms);
  for (size_t k = 0; k < SUPINE_KRIGING_TERMS; ++k) {
    found->terms[k] -= drawn[k];
  }
}

/* The parts of a sample are random fields of their own: for each state a component of the errors of
 * which nothing was observed; the error that is the same everywhere; and from first_seen on, for
 * each state, a component of the errors of which some was observed. */
static size_t first_seen(const supine_doubt *d) {
  return d->state_count + 1;
}

static bool has_part(const supine_doubt *d, size_t state, size_t part) {
  if (part == d->state_count) {
    return supine_doubt_common_square(d) > 0;
  }
  if (part > d->state_count) {
    return d->seen != NULL;
  }
  return d->seen == NULL || (d->location == NULL && d->model[state].turn > 0);
}

/* Add a part to the errors of the vertices of a lung.
 * @param seen  what is subtracted from a part of which some was observed */
static void add_part(const supine_doubt *d, size_t state, size_t part, size_t lung, const pair *p,
                     const prediction *seen, float *xyz) {
  const supine_basis_info *info = supine_basis_get_info(d->basis);
  supine_doubt_walk walk = {d, state, .end = info->lung_begin[lung + 1]};
  for (size_t i = info->lung_begin[lung]; i < walk.end; ++i) {
    const supine_doubt_features *f = supine_doubt_at(&walk, i);
    double error[AXES] = {0};
    double shift[AXES] = {0};
    double factor = 1;
    if (part < d->state_count) {
      add_pair(p, f->deviation * d->root[state][part], f->place, error);
    } else if (part == d->state_count) {
      add_pair(p, sqrt(supine_doubt_common_square(d)), f->place, error);
    } else {
      factor = f->seen_factor * d->root[state][part - first_seen(d)];
      add_pair(p, supine_kriging_deviation(&d->seen->model, f->seen.size), f->seen.position, error);
      supine_kriging_shift(d->seen, seen->weights, seen->terms, &f->seen, shift);
    }
    for (size_t k = 0; k < AXES; ++k) {
      xyz[3 * i + k] += (float)(factor * (error[k] - shift[k]));
    }
  }
}

void supine_doubt_add_positions(const supine_doubt *d, size_t state, size_t lung,
                                const double factor[DOUBT_VECTORS], float *xyz) {
  const supine_basis_info *info = supine_basis_get_info(d->basis);
  supine_doubt_walk walk = {d, state, .end = info->lung_begin[lung + 1]};
  for (size_t i = info->lung_begin[lung]; i < walk.end; ++i) {
    const supine_doubt_features *f = supine_doubt_at(&walk, i);
    for (size_t k = 0; k < AXES; ++k) {
      double sum = f->at[k];
      for (size_t v = 0; v < DOUBT_VECTORS; ++v) {
        sum += factor[v] * f->vector[v][k];
      }
      xyz[3 * i + k] += (float)sum;
    }
  }
}

supine_status supine_doubt_sample(const supine_doubt *doubt, size_t state, uint64_t seed,
                                  size_t index, float *xyz, supine_error *error) {
  const supine_basis_info *info = supine_basis_get_info(doubt->basis);
  double factor[DOUBT_VECTORS]; /* of assumed volume, heart, sliding and collapse */
  if (state >= doubt->state_count) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT, "state %zu: give one below %zu", state,
                            doubt->state_count);
  }
  uint64_t stream = begin_stream(seed, index, UINT64_MAX - 1);
  for (size_t v = 0; v < DOUBT_VECTORS; ++v) {
    factor[v] = next_normal(&stream);
  }
  memset(xyz, 0, 3 * info->vertex_count * sizeof *xyz);
  for (size_t part = 0; part <= 2 * doubt->state_count; ++part) {
    prediction seen;
    if (!has_part(doubt, state, part)) {
      continue;
    }
    if (part >= first_seen(doubt)) {
      see(doubt, seed, index, part, &seen);
    }
    for (size_t lung = 0; lung < info->lung_count; ++lung) {
      pair p;
      draw_pair(seed, index, part, lung, &p);
      add_part(doubt, state, part, lung, &p, &seen, xyz);
    }
  }
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    supine_doubt_add_positions(doubt, state, lung, factor, xyz);
  }
  if (doubt->location != NULL) {
    supine_location_move_all(doubt->location, info->vertex_count, xyz);
  }
  supine_rigid_restore(doubt->basis, xyz);
  return SUPINE_OK;
}
