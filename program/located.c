/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Fit the lungs to observed points in several postures, and measure the differences between
 * them. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <supine/posture.h>

#include "program/located.h"

static const char *const postures[SUPINE_LOCATED_POSTURES] = {"supine", "prone",   "left",
                                                              "right",  "upright", "inverted"};

static const double negligible = 0.01; /* smallest probability with which a posture counts */
static const double determined = 0.95; /* probability above which points determine a posture */

/* Fit every posture; one that no volume fits gets the share 0. */
static supine_status try_postures(const supine_locate_task *task, bool posture_given,
                                  supine_locate_residual *residuals,
                                  supine_command_located *located, supine_error *error) {
  const size_t n = task->count;
  const size_t space = supine_locate_space(n);
  supine_status status = SUPINE_OK;
  double highest = -INFINITY;
  double sum = 0.0;
  located->count = posture_given ? 1 : SUPINE_LOCATED_POSTURES;
  for (size_t k = 0; k < located->count; ++k) {
    supine_locate_task one = *task;
    if (!posture_given) {
      (void)supine_posture_gravity(postures[k], one.state.gravity);
    }
    const supine_status tried =
        supine_locate(&one, residuals + k * n, (double *)located->space + k * space,
                      &located->location[k], status == SUPINE_OK ? error : NULL);
    status = tried == SUPINE_OK ? status : tried;
    located->share[k] = tried == SUPINE_OK ? located->location[k].log_evidence : -INFINITY;
    if (located->share[k] > highest) {
      highest = located->share[k];
      located->best = &located->location[k];
      memcpy(located->residuals, residuals + k * n, n * sizeof *residuals);
    }
  }
  if (located->best == NULL) {
    return status;
  }
  for (size_t k = 0; k < located->count; ++k) {
    located->share[k] = exp(located->share[k] - highest);
    sum += located->share[k];
  }
  for (size_t k = 0; k < located->count; ++k) {
    located->share[k] /= sum;
  }
  return SUPINE_OK;
}

/* Compute the best posture's positions, and the errors of a mixture of all postures:
 * sigma^2 = sum over k of share_k (sigma_k^2 + |x_k - x|^2). */
static supine_status find_positions(const supine_basis *shown, float *xyz, float *sigma,
                                    supine_command_located *located, supine_error *error) {
  const size_t n = supine_basis_get_info(shown)->vertex_count;
  supine_status status =
      supine_locate_positions(located->best, shown, located->xyz, located->sigma, error);
  double sum = located->share[located->best - located->location];
  for (size_t i = 0; i < n && status == SUPINE_OK; ++i) {
    located->sigma[i] *= located->sigma[i] * (float)sum;
  }
  for (size_t k = 0; k < located->count && status == SUPINE_OK; ++k) {
    const double share = located->share[k];
    if (&located->location[k] == located->best || share < negligible) {
      continue;
    }
    status = supine_locate_positions(&located->location[k], shown, xyz, sigma, error);
    sum += share;
    for (size_t i = 0; i < n && status == SUPINE_OK; ++i) {
      float square = sigma[i] * sigma[i];
      for (size_t j = 3 * i; j < 3 * i + 3; ++j) {
        square += (xyz[j] - located->xyz[j]) * (xyz[j] - located->xyz[j]);
      }
      located->sigma[i] += (float)share * square;
    }
  }
  for (size_t i = 0; i < n && status == SUPINE_OK; ++i) {
    located->sigma[i] = sqrtf(located->sigma[i] / (float)sum);
  }
  return status;
}

supine_status supine_command_located_find(const supine_locate_task *task, bool posture_given,
                                          const supine_basis *shown,
                                          supine_command_located *located, supine_error *error) {
  const size_t n = supine_basis_get_info(shown)->vertex_count;
  const size_t tries = SUPINE_LOCATED_POSTURES;
  supine_locate_residual *residuals = malloc(tries * task->count * sizeof *residuals);
  float *xyz = malloc(3 * n * sizeof *xyz);
  float *sigma = malloc(n * sizeof *sigma);
  located->residuals = malloc(task->count * sizeof *residuals);
  located->xyz = malloc(3 * n * sizeof *xyz);
  located->sigma = malloc(n * sizeof *sigma);
  located->space = malloc(tries * supine_locate_space(task->count) * sizeof(double));
  supine_status status = SUPINE_OK;
  if (residuals == NULL || xyz == NULL || sigma == NULL || located->residuals == NULL ||
      located->xyz == NULL || located->sigma == NULL || located->space == NULL) {
    status = supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu vertices", n);
  } else {
    status = try_postures(task, posture_given, residuals, located, error);
  }
  if (status == SUPINE_OK) {
    status = find_positions(shown, xyz, sigma, located, error);
  }
  free(residuals);
  free(xyz);
  free(sigma);
  return status;
}

void supine_command_located_free(supine_command_located *located) {
  free(located->residuals);
  free(located->xyz);
  free(located->sigma);
  free(located->space);
  *located = (supine_command_located){0};
}

void supine_command_located_tell(const supine_command_located *located, bool posture_given) {
  const supine_location *best = located->best;
  supine_state posture = best->state;
  char text[160];
  posture.volume = (supine_volume){0};
  posture.lung_count = 0;
  (void)supine_state_describe(&posture, text, sizeof text);
  const double share = located->share[best - located->location];
  if (posture_given) {
    (void)printf("posture: %s, as given\n", text);
  } else {
    (void)printf("posture: %s, %.0f %% likely; %s\n", text, 100.0 * share,
                 share >= determined ? "the points determine it"
                                     : "the points do not determine it: give --posture");
  }
  if (best->volume > 0.0) {
    (void)printf("volume: %.0f mL", best->volume);
    if (best->volume_error > 0.0) {
      (void)printf(" +- %.0f mL, found (+- %.0f mL without points)", best->volume_error,
                   best->volume_prior_error);
    } else {
      (void)printf(", as given");
    }
    (void)putchar('\n');
  }
}
