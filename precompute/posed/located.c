/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Try postures of the lungs, and weight them by the likelihood of the observed points. */
#include <math.h>
#include <string.h>

#include <supine/posture.h>

#include "precompute/posed/located.h"

#include "base/remedy.h"
#include "base/text.h"

static const char *const postures[SUPINE_POSED_POSTURES] = {"supine", "prone",   "left",
                                                            "right",  "upright", "inverted"};

static const double negligible = 0.01; /* probability below which a posture is ignored */

void supine_posed_located_free(supine_posed_located *located) {
  supine_arena_free(&located->arena);
}

/* Fit the lungs in the given posture or in all six; a failed fit gets probability 0. Return the
 * status of the first failed fit if all of them fail. */
static supine_status try_postures(const supine_locate_task *task, bool posture_given,
                                  supine_posed_located *located, supine_error *error) {
  const size_t count = posture_given ? 1 : SUPINE_POSED_POSTURES;
  supine_arena *arena = &located->arena;
  supine_status status = SUPINE_OK;
  double sum = 0.0;
  located->count = count;
  located->best = NULL;
  for (size_t k = 0; k < count; ++k) {
    supine_locate_task one = *task;
    supine_locate_residual *residuals = supine_arena_take(arena, task->count, sizeof *residuals);
    double *space = supine_arena_take(arena, supine_locate_space(task->count), sizeof *space);
    SUPINE_TRY(supine_arena_check(arena, error, "%zu points", task->count));
    if (!posture_given) {
      (void)supine_posture_gravity(postures[k], one.state.gravity);
    }
    const supine_status tried = supine_locate(&one, residuals, space, &located->location[k],
                                              status == SUPINE_OK ? error : NULL);
    status = status == SUPINE_OK ? tried : status;
    if (tried != SUPINE_OK) {
      located->probability[k] = -INFINITY;
      continue;
    }
    const supine_location_info *found = supine_location_get_info(located->location[k]);
    located->probability[k] = found->log_evidence;
    if (located->best == NULL || found->log_evidence > located->best->log_evidence) {
      located->best = found;
      located->most_probable = k;
      located->residuals = residuals;
    }
  }
  if (located->best == NULL) {
    return status;
  }
  for (size_t k = 0; k < count; ++k) {
    located->probability[k] = exp(located->probability[k] - located->best->log_evidence);
    sum += located->probability[k];
  }
  for (size_t k = 0; k < count; ++k) {
    located->probability[k] /= sum;
  }
  located->best_probability = 1.0 / sum;
  return SUPINE_OK;
}

/* If the points fit ten times better when they are read in another way, say so in the error. */
static void suggest_reading(const supine_locate_task *task, bool posture_given,
                            supine_posed_located *located, supine_error *error) {
  static const double residual_most = 40.0; /* the largest that supine_locate accepts, mm */
  static const struct {
    const char *way;
    double factor[3];
    const char *argument, *value;
  } readings[] = {{"in centimetres", {10.0, 10.0, 10.0}, "units", "cm"},
                  {"in RAS", {-1.0, -1.0, 1.0}, "axes", "RAS"},
                  {"mirrored", {-1.0, 1.0, 1.0}, "axes", "RPS"}};
  supine_observation other[SUPINE_LOCATE_POINTS_MAX];
  supine_locate_task changed = *task;
  double most = residual_most;
  for (size_t k = 0; k < located->count; ++k) {
    most = fmax(most, supine_location_get_info(located->location[k])->residual_rms);
  }
  changed.observed = other;
  if (task->count > 2) {
    for (size_t i = 0; i < sizeof readings / sizeof *readings; ++i) {
      memcpy(other, task->observed, task->count * sizeof *other);
      for (size_t j = 0; j < 3 * task->count; ++j) {
        other[j / 3].position[j % 3] *= readings[i].factor[j % 3];
        other[j / 3].from[j % 3] *= readings[i].factor[j % 3];
      }
      if (try_postures(&changed, posture_given, located, NULL) == SUPINE_OK &&
          10.0 * pow(located->best->residual_rms, 2.0) < most * most) {
        supine_text_add(error->message, sizeof error->message, ". Read %s, they fit within %.1f mm",
                        readings[i].way, located->best->residual_rms);
        const supine_remedy advice[SUPINE_REMEDIES_MAX] = {
            supine_remedy_give(readings[i].argument, readings[i].value, "")};
        supine_error_advise(error, advice);
        return;
      }
    }
  }
}

/* Compute located->xyz, the positions x in the most probable posture, and located->sigma. If
 * posture k has probability p_k, positions x_k and expected errors s_k, then located->sigma squared
 * is the mean of s_k^2 + |x_k - x|^2 over all k, weighted by p_k. */
static supine_status find_positions(const supine_basis *shown, supine_posed_located *located,
                                    supine_error *error) {
  const size_t n = supine_basis_get_info(shown)->vertex_count;
  SUPINE_ARENA arena = {0};
  float *xyz = supine_arena_take(&arena, 3 * n, sizeof *xyz);
  float *sigma = supine_arena_take(&arena, n, sizeof *sigma);
  double *squares = supine_arena_zeros(&arena, n, sizeof *squares);
  located->xyz = supine_arena_take(&located->arena, 3 * n, sizeof *xyz);
  located->sigma = supine_arena_take(&located->arena, n, sizeof *sigma);
  double sum = 0.0;
  if (arena.failed || located->arena.failed) {
    return supine_error_memory(error, "%zu vertices", n);
  }
  SUPINE_TRY(supine_locate_positions(located->location[located->most_probable], shown, located->xyz,
                                     located->sigma, error));
  for (size_t k = 0; k < located->count; ++k) {
    const double share = located->probability[k];
    if (share < negligible) {
      continue;
    }
    SUPINE_TRY(supine_locate_positions(located->location[k], shown, xyz, sigma, error));
    sum += share;
    for (size_t i = 0; i < n; ++i) {
      double square = (double)sigma[i] * (double)sigma[i];
      for (size_t j = 3 * i; j < 3 * i + 3; ++j) {
        square += pow((double)xyz[j] - (double)located->xyz[j], 2.0);
      }
      squares[i] += share * square;
    }
  }
  for (size_t i = 0; i < n; ++i) {
    const double square = squares[i] / sum;
    located->sigma[i] = (float)sqrt(square);
    located->expected_rms += square / (double)n;
    located->expected_largest = fmax(located->expected_largest, sqrt(square));
  }
  located->expected_rms = sqrt(located->expected_rms);
  return SUPINE_OK;
}

supine_status supine_posed_locate(const supine_locate_task *task, bool posture_given,
                                  const supine_basis *shown, supine_posed_located *located,
                                  supine_error *error) {
  const supine_status status = try_postures(task, posture_given, located, error);
  if (status == SUPINE_ERROR_NUMERICAL) {
    suggest_reading(task, posture_given, located, error);
  }
  return status == SUPINE_OK ? find_positions(shown, located, error) : status;
}
