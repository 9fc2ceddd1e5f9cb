/* SPDX-License-Identifier: GPL-3.0-or-later */
/* How much of the surface a state turns inside out. */
#include <math.h>
#include <stdlib.h>

#include "precompute/projection/accuracy.h"
#include "sh/base/parallel.h"
#include "sh/base/vec3.h"
#include <supine/sh.h>
#include <supine/volume.h>

#include "precompute/projection/compression.h"

enum { POSTURES = 6, SAMPLES_MAX = 50000 };

typedef struct search {
  const supine_mesh *mesh;
  const double *directions;
  const supine_compression *field;
  double weights[POSTURES][SUPINE_MODES_MADE_MAX]; /* with the breath scale in them */
  bool reached[POSTURES];
  size_t (*turned)[POSTURES]; /* one row a thread */
  size_t stride;              /* from one triangle that is looked at to the next */
} search;

/* Twice the area times the normal of the triangle whose corners are a, b and c. */
static void area_vector(const double *a, const double *b, const double *c, double *vector) {
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3;
    const int k = (i + 2) % 3;
    vector[i] = (b[j] - a[j]) * (c[k] - a[k]) - (b[k] - a[k]) * (c[j] - a[j]);
  }
}

static void place_corner(const search *s, size_t vertex, size_t posture, double *at) {
  const size_t modes = s->field->mode_count;
  const float *c = s->field->coefficients + vertex * modes;
  double amount = 0.0;
  for (size_t k = 0; k < modes; ++k) {
    amount += s->weights[posture][k] * (double)c[k];
  }
  for (size_t i = 0; i < 3; ++i) {
    at[i] = s->mesh->vertices[3 * vertex + i] + amount * s->directions[3 * vertex + i];
  }
}

static void search_range(void *context, size_t begin, size_t end, size_t thread) {
  const search *s = context;
  for (size_t sample = begin; sample < end; ++sample) {
    const uint32_t *corner = s->mesh->triangles + 3 * sample * s->stride;
    double rest[3];
    area_vector(s->mesh->vertices + 3 * (size_t)corner[0],
                s->mesh->vertices + 3 * (size_t)corner[1],
                s->mesh->vertices + 3 * (size_t)corner[2], rest);
    for (size_t g = 0; g < POSTURES; ++g) {
      double at[3][3];
      double moved[3];
      for (size_t i = 0; i < 3; ++i) {
        place_corner(s, corner[i], g, at[i]);
      }
      area_vector(at[0], at[1], at[2], moved);
      s->turned[thread][g] += supine_dot(rest, moved) < 0.0 ? 1 : 0;
    }
  }
}

/* Weights for gravity along axis g / 2, forwards or backwards. */
static supine_status find_posture(search *s, size_t g, const supine_volume_forms *forms,
                                  const supine_accuracy_state *state, size_t band,
                                  double *harmonics) {
  const supine_compression *field = s->field;
  double gravity[3] = {0.0, 0.0, 0.0};
  gravity[g / 2] = g % 2 == 0 ? 1.0 : -1.0;
  const supine_status status = supine_sh_evaluate(band, gravity, harmonics);
  if (status != SUPINE_OK) {
    return status;
  }
  double *w = s->weights[g];
  supine_projection_compression_weights(field, harmonics, w);
  double cubic[3];
  double scale = 0.0;
  supine_physics_volume_forms_contract(forms, w, cubic);
  s->reached[g] = supine_volume_scale(cubic, supine_accuracy_state_volume(state, harmonics), &scale,
                                      NULL) == SUPINE_OK;
  for (size_t k = 0; k < field->mode_count; ++k) {
    w[k] *= scale;
  }
  return SUPINE_OK;
}

supine_status supine_accuracy_turned_over(const supine_lungs *lungs, const double *directions,
                                          const supine_compression *compression,
                                          const supine_volume_forms *forms,
                                          const supine_accuracy_state *state, double *share) {
  const size_t band = compression->band < 2 ? 2 : compression->band;
  if (compression->mode_count > SUPINE_MODES_MADE_MAX) {
    return SUPINE_ERROR_ARGUMENT;
  }
  const supine_mesh *mesh = &lungs->mesh;
  const size_t threads = supine_thread_count();
  const size_t stride = (mesh->triangle_count + SAMPLES_MAX - 1) / SAMPLES_MAX;
  const size_t samples = (mesh->triangle_count + stride - 1) / stride;
  search *s = calloc(1, sizeof *s);
  size_t(*turned)[POSTURES] = calloc(threads, sizeof *turned);
  double *harmonics = malloc(supine_sh_count(band) * sizeof *harmonics);
  supine_status status =
      s == NULL || turned == NULL || harmonics == NULL ? SUPINE_ERROR_MEMORY : SUPINE_OK;
  if (status == SUPINE_OK) {
    s->mesh = mesh;
    s->directions = directions;
    s->field = compression;
    s->turned = turned;
    s->stride = stride;
  }
  for (size_t g = 0; g < POSTURES && status == SUPINE_OK; ++g) {
    status = find_posture(s, g, forms, state, band, harmonics);
  }
  if (status == SUPINE_OK) {
    supine_parallel_for(samples, 256, threads, search_range, s);
    *share = 0.0;
    for (size_t g = 0; g < POSTURES; ++g) {
      size_t count = 0;
      for (size_t t = 0; t < threads; ++t) {
        count += turned[t][g];
      }
      *share = s->reached[g] ? fmax(*share, (double)count / (double)samples) : *share;
    }
  }
  free(s);
  free(turned);
  free(harmonics);
  return status;
}
