/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compare postures of a basis, pair by pair and over all directions of gravity. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "program/report/comparison.h"
#include "sh/base/vec3.h"

/* Compute how a breath from the comparison's volume is distributed over lungs and slabs. */
static supine_status find_breath(const supine_comparison *c, const supine_posture_item *item,
                                 float *xyz[2], supine_compared_posture *posture,
                                 supine_error *error) {
  const supine_basis_info *info = supine_basis_get_info(c->basis);
  supine_slab slabs[SUPINE_LUNGS_MAX * SUPINE_COMPARISON_SLABS];
  supine_pose after = posture->pose;
  supine_state state = {.volume = {SUPINE_VOLUME_ABSOLUTE, c->breath}};
  memcpy(state.gravity, item->gravity, sizeof state.gravity);
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    state.volume.ml += posture->volume[lung];
  }
  supine_status status = supine_basis_gains(c->basis, &state, &after, error);
  if (status == SUPINE_OK) {
    status = supine_options_pose_check(c->basis, c->command, c->allow_folds, &after, error);
  }
  if (status != SUPINE_OK) {
    return status;
  }
  supine_basis_volumes(c->basis, &after, posture->gain);
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    posture->gain[lung] -= posture->volume[lung];
  }
  supine_deform(c->basis, &posture->pose, xyz[0]);
  supine_deform(c->basis, &after, xyz[1]);
  status = supine_compare_slabs(c->basis, item->gravity, xyz[0], xyz[1], SUPINE_COMPARISON_SLABS,
                                slabs, error);
  for (size_t i = 0; status == SUPINE_OK && i < info->lung_count * SUPINE_COMPARISON_SLABS; ++i) {
    posture->slab[i % SUPINE_COMPARISON_SLABS].volume += slabs[i].volume;
    posture->slab[i % SUPINE_COMPARISON_SLABS].gain += slabs[i].gain;
  }
  return status;
}

static supine_status find_posture(const supine_comparison *c, const supine_posture_item *item,
                                  float *distance, float *xyz[2], supine_compared_posture *posture,
                                  supine_error *error) {
  const bool closed = supine_basis_get_info(c->basis)->has_volume;
  supine_state state = c->state;
  memcpy(state.gravity, item->gravity, sizeof state.gravity);
  supine_status status = supine_compare_pose(c->compare, &state, c->rms, &posture->pose, error);
  if (status != SUPINE_OK) {
    return status;
  }
  supine_compare_distances(c->compare, &posture->pose, &c->reference.pose, distance);
  supine_compare_statistics(c->compare, distance, &posture->displacement);
  if (!closed) {
    return SUPINE_OK;
  }
  supine_basis_volumes(c->basis, &posture->pose, posture->volume);
  status = supine_options_pose_check(c->basis, c->command, c->allow_folds, &posture->pose, error);
  return status == SUPINE_OK ? find_breath(c, item, xyz, posture, error) : status;
}

static supine_status find_energy(supine_comparison *c, supine_error *error) {
  const size_t band = supine_basis_get_info(c->basis)->band;
  double *energy = calloc(band + 1, sizeof *energy);
  if (energy == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "out of memory");
  }
  supine_compare_energy(c->compare, energy);
  double total = 0.0;
  c->constant = energy[0];
  for (size_t l = 0; l <= band; ++l) {
    total += energy[l];
    *(l % 2 == 1 ? &c->odd : &c->even) += l == 0 ? 0.0 : energy[l];
  }
  if (total > 0.0) {
    c->constant /= total;
    c->odd /= total;
    c->even /= total;
  }
  free(energy);
  return SUPINE_OK;
}

/* Compute the expected error of the displacement between two states, mm RMS; 0 if unknown. */
static supine_status find_error(const supine_comparison *c, const supine_state *state,
                                const supine_state *from, double *rms, supine_error *error) {
  supine_expected expected = {0};
  const supine_status status =
      c->rms > 0.0 ? SUPINE_OK
                   : supine_options_expected_find(c->basis, state, from, &expected, error);
  *rms = expected.rms;
  supine_options_expected_free(&expected);
  return status;
}

static supine_status find_errors(supine_comparison *c, supine_error *error) {
  const size_t count = c->postures.count;
  supine_status status = SUPINE_OK;
  for (size_t i = 0; i < count && status == SUPINE_OK; ++i) {
    supine_state state = c->state;
    memcpy(state.gravity, c->postures.item[i].gravity, sizeof state.gravity);
    status = find_error(c, &state, &c->reference.state, &c->posture[i].expected_error, error);
    for (size_t j = i + 1; j < count && status == SUPINE_OK; ++j) {
      supine_state other = c->state;
      memcpy(other.gravity, c->postures.item[j].gravity, sizeof other.gravity);
      status = find_error(c, &other, &state, &c->pair_error[i * count + j], error);
      c->pair_error[j * count + i] = c->pair_error[i * count + j];
    }
  }
  return status;
}

double supine_report_from_supine(const supine_comparison *c, const double gravity[3]) {
  static const double supine[3] = {0.0, 1.0, 0.0};
  const double *direction[2] = {supine, gravity};
  supine_pose pose[2];
  for (int side = 0; side < 2; ++side) {
    supine_state state = c->state;
    memcpy(state.gravity, direction[side], sizeof state.gravity);
    if (supine_compare_pose(c->compare, &state, c->rms, &pose[side], NULL) != SUPINE_OK) {
      return NAN;
    }
  }
  return supine_compare_rms(c->compare, &pose[1], &pose[0]);
}

/* Find the direction of gravity farthest from supine among some that cover the sphere evenly, 4.5
 * degrees apart. */
static void find_farthest(supine_comparison *c) {
  enum { DIRECTIONS = 2048 };
  for (size_t i = 0; i < DIRECTIONS; ++i) {
    double g[3];
    supine_spiral((double)i, DIRECTIONS, 0.0, g);
    const double rms = supine_report_from_supine(c, g);
    c->directions += isnan(rms) ? 0 : 1;
    if (rms > c->farthest_rms) {
      c->farthest_rms = rms;
      memcpy(c->farthest, g, sizeof g);
    }
  }
}

supine_status supine_report_find(supine_comparison *c, supine_error *error) {
  const size_t n = supine_basis_get_info(c->basis)->vertex_count;
  const size_t count = c->postures.count;
  supine_status status = SUPINE_ERROR_MEMORY;
  float *distance = malloc(n * sizeof *distance);
  float *xyz[2] = {malloc(3 * n * sizeof(float)), malloc(3 * n * sizeof(float))};
  c->posture = calloc(count, sizeof *c->posture);
  c->pair = calloc(count * count, sizeof *c->pair);
  c->pair_error = calloc(count * count, sizeof *c->pair_error);
  if (distance == NULL || xyz[0] == NULL || xyz[1] == NULL || c->posture == NULL ||
      c->pair == NULL || c->pair_error == NULL) {
    (void)supine_error_set(error, status, "out of memory");
    goto cleanup;
  }
  status = supine_options_reference(c->basis, &c->from, true, &c->reference, error);
  if (status == SUPINE_OK) {
    status = supine_compare_create(c->basis, &c->compare, error);
  }
  for (size_t i = 0; i < count && status == SUPINE_OK; ++i) {
    supine_error wrong = {SUPINE_OK, ""};
    status = find_posture(c, &c->postures.item[i], distance, xyz, &c->posture[i], &wrong);
    if (status != SUPINE_OK) {
      (void)supine_error_set(error, status, "%s: %s", c->postures.item[i].name,
                             wrong.message[0] != '\0' ? wrong.message
                                                      : supine_status_string(status));
    }
  }
  if (status != SUPINE_OK) {
    goto cleanup;
  }
  for (size_t i = 0; i < count; ++i) {
    for (size_t j = i + 1; j < count; ++j) {
      const supine_compared_posture *a = &c->posture[i];
      const supine_compared_posture *b = &c->posture[j];
      supine_compare_distances(c->compare, &a->pose, &b->pose, distance);
      supine_compare_statistics(c->compare, distance, &c->pair[i * count + j]);
      c->pair[j * count + i] = c->pair[i * count + j];
    }
  }
  status = find_errors(c, error);
  if (status == SUPINE_OK) {
    status = find_energy(c, error);
  }
  if (status == SUPINE_OK) {
    find_farthest(c);
  }
cleanup:
  free(distance);
  free(xyz[0]);
  free(xyz[1]);
  return status;
}

void supine_report_free(supine_comparison *c) {
  supine_compare_destroy(c->compare);
  free(c->posture);
  free(c->pair);
  free(c->pair_error);
  c->compare = NULL;
  c->posture = NULL;
  c->pair = NULL;
  c->pair_error = NULL;
}

void supine_report_volume(const supine_comparison *c, char *text, size_t size) {
  if (c->rms > 0.0) {
    (void)snprintf(text, size, "%g mm RMS displacement", c->rms);
    return;
  }
  char whole[160];
  (void)supine_state_describe(&c->state, whole, sizeof whole);
  const char *space = strchr(whole, ' '); /* the posture, supine, ends there */
  (void)snprintf(text, size, "%s", space == NULL ? "as given" : space + 1);
}

bool supine_report_has_errors(const supine_comparison *c) {
  double sum = 0.0;
  for (size_t i = 0; i < c->postures.count; ++i) {
    sum += c->posture[i].expected_error;
  }
  return sum > 0.0;
}

double supine_report_gain(const supine_comparison *c, size_t posture) {
  double gain = 0.0;
  for (size_t lung = 0; lung < supine_basis_get_info(c->basis)->lung_count; ++lung) {
    gain += c->posture[posture].gain[lung];
  }
  return gain;
}
