/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The full solve at directions that no grid used. */
#include <math.h>
#include <stdlib.h>

#include "sh/base/vec3.h"

#include "precompute/projection/held_out.h"
#include "precompute/projection/compression.h"
#include "precompute/projection/sampler.h"
#include "sh/base/clones.h"
#include "sh/base/parallel.h"
#include <supine/sh.h>

void supine_accuracy_held_out_directions(size_t count, double *directions) {
  static const double off_the_grids = 0.3; /* rad: grids have a node at longitude 0 */
  for (size_t i = 0; i < count; ++i) {
    supine_spiral((double)i, (double)count, off_the_grids, directions + 3 * i);
  }
}

void supine_accuracy_held_out_free(supine_held_out *held_out) {
  free(held_out->directions);
  free(held_out->fields);
  free(held_out->functions);
  free(held_out->cubic);
  *held_out = (supine_held_out){0};
}

/* Directions, and space for the volumes of closed lungs. */
static supine_status begin(size_t count, bool closed, supine_held_out *made) {
  *made = (supine_held_out){0};
  made->directions = malloc(3 * count * sizeof(double));
  made->cubic = malloc(3 * count * sizeof(double));
  if (made->directions == NULL || made->cubic == NULL) {
    return SUPINE_ERROR_MEMORY;
  }
  supine_accuracy_held_out_directions(count, made->directions);
  made->truth.direction_count = count;
  made->truth.directions = made->directions;
  made->truth.cubic = closed ? made->cubic : NULL;
  return SUPINE_OK;
}

supine_status supine_accuracy_held_out_linear(const supine_lungs *lungs, const supine_model *model,
                                              const supine_projection *projection,
                                              const supine_volume_forms *forms, size_t count,
                                              supine_held_out *held_out, supine_error *error) {
  supine_held_out made;
  supine_status status = begin(count, forms != NULL, &made);
  double *range = malloc(2 * count * sizeof *range);
  made.functions = malloc(count * projection->rank * sizeof *made.functions);
  if (status != SUPINE_OK || range == NULL || made.functions == NULL) {
    status = SUPINE_ERROR_MEMORY;
    goto cleanup;
  }
  status = supine_physics_height_range(lungs, model->force.pair, count, made.directions, range,
                                       range + count);
  for (size_t d = 0; d < count && status == SUPINE_OK; ++d) {
    double *row = made.functions + d * projection->rank;
    supine_physics_force_functions(lungs, &model->force, made.directions + 3 * d, range[d],
                                   range[count + d], row);
    if (forms != NULL) {
      supine_physics_volume_forms_contract(forms, row, made.cubic + 3 * d);
    }
  }
  made.truth.rank = projection->rank;
  made.truth.columns = projection->columns;
  made.truth.functions = made.functions;
cleanup:
  free(range);
  if (status != SUPINE_OK) {
    supine_accuracy_held_out_free(&made);
    return supine_error_set(error, status, "no memory for %zu held-out directions", count);
  }
  *held_out = made;
  return SUPINE_OK;
}

typedef struct guess_work {
  const supine_compression *guess;
  const double *weights; /* [D, K] */
  double *fields;        /* [D, N] */
} guess_work;

SUPINE_CLONES static void guess_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const guess_work *work = context;
  const size_t n = work->guess->vertex_count;
  const size_t modes = work->guess->mode_count;
  for (size_t d = begin; d < end; ++d) {
    const double *weights = work->weights + d * modes;
    for (size_t i = 0; i < n; ++i) {
      const float *c = work->guess->coefficients + i * modes;
      double sum = 0.0;
      for (size_t k = 0; k < modes; ++k) {
        sum += weights[k] * (double)c[k];
      }
      work->fields[d * n + i] = sum;
    }
  }
}

/* What a compression says at every direction. */
static supine_status find_guesses(const supine_compression *guess, const supine_held_out *made) {
  const size_t terms = supine_sh_count(guess->band);
  const size_t count = made->truth.direction_count;
  double *y = malloc(terms * sizeof *y);
  double *weights = malloc(count * guess->mode_count * sizeof *weights);
  supine_status status = y == NULL || weights == NULL ? SUPINE_ERROR_MEMORY : SUPINE_OK;
  for (size_t d = 0; d < count && status == SUPINE_OK; ++d) {
    status = supine_sh_evaluate(guess->band, made->directions + 3 * d, y);
    supine_projection_compression_weights(guess, y, weights + d * guess->mode_count);
  }
  if (status == SUPINE_OK) {
    guess_work work = {guess, weights, made->fields};
    supine_parallel_for(count, 1, 0, guess_range, &work);
  }
  free(y);
  free(weights);
  return status;
}

supine_status supine_accuracy_held_out_sampled(const supine_lungs *lungs, const supine_model *model,
                                               const double *directions,
                                               const supine_compression *guess, size_t count,
                                               supine_held_out *held_out, supine_error *error) {
  const size_t n = lungs->mesh.vertex_count;
  const bool closed = lungs->topology.closed;
  supine_sampler *sampler = NULL;
  supine_held_out made;
  supine_status status = begin(count, closed, &made);
  made.fields = malloc(count * n * sizeof *made.fields);
  if (status != SUPINE_OK || made.fields == NULL || find_guesses(guess, &made) != SUPINE_OK) {
    status = supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu held-out directions",
                              count);
    goto cleanup;
  }
  status = supine_projection_sampler_create(lungs, model, &sampler, error);
  if (status == SUPINE_OK) {
    status = supine_projection_sampler_solve(sampler, count, made.directions, true, made.fields,
                                             NULL, error);
  }
  for (size_t d = 0; d < count && closed && status == SUPINE_OK; ++d) {
    supine_volume_forms forms = {0};
    const double one = 1.0;
    status = supine_physics_volume_forms_create(lungs, model->share, directions,
                                                made.fields + d * n, 1, &forms, error);
    if (status == SUPINE_OK) {
      supine_physics_volume_forms_contract(&forms, &one, made.cubic + 3 * d);
    }
    supine_physics_volume_forms_free(&forms);
  }
  made.truth.fields = made.fields;
cleanup:
  supine_projection_sampler_destroy(sampler);
  if (status != SUPINE_OK) {
    supine_accuracy_held_out_free(&made);
    return status;
  }
  *held_out = made;
  return SUPINE_OK;
}
