/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compares postures of a basis, pair by pair and over the whole sphere. */
#include <stdlib.h>
#include <string.h>

#include <supine/volume.h>

#include "program/options/volume.h"
#include "program/report/comparison.h"

bool supine_report_knows_rest(const supine_comparison *c) {
  return supine_basis_get_info(c->basis)->resting_volume != NULL;
}

/* Who ventilates in a breath: from the inflation on where rest is known, else from the file's
 * surface up to it. */
static supine_status find_breath(const supine_comparison *c, const supine_posture_item *item,
                                 float *xyz[2], supine_compared_posture *posture,
                                 supine_error *error) {
  const supine_basis_info *info = supine_basis_get_info(c->basis);
  const bool known = supine_report_knows_rest(c);
  supine_slab slabs[SUPINE_LUNGS_MAX * SUPINE_COMPARISON_SLABS];
  double cubic[3];
  double after[SUPINE_LUNGS_MAX];
  double scale = posture->scales[0];
  supine_status status = SUPINE_OK;
  if (known) {
    supine_basis_cubic(c->basis, posture->weights, cubic);
    status = supine_basis_scale(c->basis, posture->weights,
                                supine_volume_at(cubic, scale) + c->breath, &scale, error);
  }
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    after[lung] = scale;
    const double before =
        known ? supine_basis_lung_volume(c->basis, lung, posture->weights, posture->scales[lung])
              : 0.0;
    posture->gain[lung] =
        supine_basis_lung_volume(c->basis, lung, posture->weights, scale) - before;
  }
  if (status != SUPINE_OK) {
    return status;
  }
  status = supine_options_volume_check(c->basis, c->command, c->allow_folds, posture->weights,
                                       after, error);
  if (status != SUPINE_OK) {
    return status;
  }
  supine_deform(c->basis, posture->weights, posture->scales, xyz[0]);
  supine_deform(c->basis, posture->weights, after, xyz[1]);
  status = supine_compare_slabs(c->basis, item->gravity, known ? xyz[0] : NULL, xyz[1],
                                SUPINE_COMPARISON_SLABS, slabs, error);
  for (size_t i = 0; status == SUPINE_OK && i < info->lung_count * SUPINE_COMPARISON_SLABS; ++i) {
    posture->slab[i % SUPINE_COMPARISON_SLABS].volume += slabs[i].volume;
    posture->slab[i % SUPINE_COMPARISON_SLABS].gain += slabs[i].gain;
  }
  return status;
}

static supine_status find_posture(const supine_comparison *c, const supine_posture_item *item,
                                  float *distance, float *xyz[2], supine_compared_posture *posture,
                                  supine_error *error) {
  const supine_basis_info *info = supine_basis_get_info(c->basis);
  double scale = 0.0;
  supine_status status = supine_basis_weights(c->basis, item->gravity, posture->weights);
  if (status != SUPINE_OK) {
    return supine_error_set(error, status, "gravity has no direction");
  }
  status = supine_compare_scale(c->compare, &c->inflation, item->gravity, posture->weights, &scale,
                                error);
  if (status != SUPINE_OK) {
    return status;
  }
  if (info->has_volume) {
    supine_options_volume_reference(c->basis, posture->volume);
  }
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    posture->scales[lung] = scale;
    if (info->has_volume) {
      posture->volume[lung] += supine_basis_lung_volume(c->basis, lung, posture->weights, scale);
    }
  }
  supine_compare_distances(c->compare, posture->weights, posture->scales, NULL, NULL, distance);
  supine_compare_statistics(c->compare, distance, &posture->displacement);
  if (info->has_volume) {
    status = supine_options_volume_check(c->basis, c->command, c->allow_folds, posture->weights,
                                         posture->scales, error);
  }
  return info->has_volume && status == SUPINE_OK ? find_breath(c, item, xyz, posture, error)
                                                 : status;
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

supine_status supine_report_find(supine_comparison *c, supine_error *error) {
  static const double supine[3] = {0.0, 1.0, 0.0};
  const size_t n = supine_basis_get_info(c->basis)->vertex_count;
  const size_t count = c->postures.count;
  supine_status status = SUPINE_ERROR_MEMORY;
  float *distance = malloc(n * sizeof *distance);
  float *xyz[2] = {malloc(3 * n * sizeof(float)), malloc(3 * n * sizeof(float))};
  c->posture = calloc(count, sizeof *c->posture);
  c->pair = calloc(count * count, sizeof *c->pair);
  if (distance == NULL || xyz[0] == NULL || xyz[1] == NULL || c->posture == NULL ||
      c->pair == NULL) {
    (void)supine_error_set(error, status, "out of memory");
    goto cleanup;
  }
  status = supine_compare_create(c->basis, &c->compare, error);
  for (size_t i = 0; i < count && status == SUPINE_OK; ++i) {
    supine_error wrong = {SUPINE_OK, ""};
    status = find_posture(c, &c->postures.item[i], distance, xyz, &c->posture[i], &wrong);
    if (status != SUPINE_OK) {
      (void)supine_error_set(error, status, "%s: %s", c->postures.item[i].name, wrong.message);
    }
  }
  if (status != SUPINE_OK) {
    goto cleanup;
  }
  for (size_t i = 0; i < count; ++i) {
    for (size_t j = i + 1; j < count; ++j) {
      const supine_compared_posture *a = &c->posture[i];
      const supine_compared_posture *b = &c->posture[j];
      supine_compare_distances(c->compare, a->weights, a->scales, b->weights, b->scales, distance);
      supine_compare_statistics(c->compare, distance, &c->pair[i * count + j]);
      c->pair[j * count + i] = c->pair[i * count + j];
    }
  }
  status = find_energy(c, error);
  if (status == SUPINE_OK) {
    status = supine_compare_search(c->compare, &c->inflation, supine, SUPINE_COMPARISON_DIRECTIONS,
                                   &c->extremes, error);
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
  c->compare = NULL;
  c->posture = NULL;
  c->pair = NULL;
}

void supine_report_inflation(const supine_comparison *c, char *text, size_t size) {
  if (c->inflation.kind == SUPINE_INFLATION_REST) {
    (void)snprintf(text, size, c->inflation.amount == 0.0 ? "rest" : "rest %+g mL",
                   c->inflation.amount);
    return;
  }
  (void)snprintf(text, size, supine_report_knows_rest(c) ? "full %+g %s" : "%g %s",
                 c->inflation.amount,
                 c->inflation.kind == SUPINE_INFLATION_VOLUME ? "mL" : "mm RMS displacement");
}

double supine_report_gain(const supine_comparison *c, size_t posture) {
  double gain = 0.0;
  for (size_t lung = 0; lung < supine_basis_get_info(c->basis)->lung_count; ++lung) {
    gain += c->posture[posture].gain[lung];
  }
  return gain;
}
