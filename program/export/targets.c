/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Morph targets of a basis: all modes or the best eight; weights as they come, or within 0 to 1. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sh/base/vec3.h"
#include <supine/sh.h>

#include "program/export/targets.h"

enum { EIGHT = 8, DIRECTIONS = 4096, COUNT_MAX = 32767 };
static const double margin =
    0.02; /* Margin added to each range on both sides, for directions between those sampled. */

static bool allocate(const export_source *source, export_targets *targets) {
  const size_t k = source->info->mode_count;
  targets->mix = calloc(k * k, sizeof *targets->mix);
  targets->modes = calloc(k * source->terms, sizeof *targets->modes);
  targets->offset = calloc(2 * k, sizeof *targets->offset);
  targets->unit = calloc(2 * k, sizeof *targets->unit);
  return targets->mix != NULL && targets->modes != NULL && targets->offset != NULL &&
         targets->unit != NULL;
}

void supine_export_targets_free(export_targets *targets) {
  free(targets->mix);
  free(targets->modes);
  free(targets->offset);
  free(targets->unit);
  *targets = (export_targets){0};
}

static void keep_modes(const export_source *source, export_targets *targets) {
  const size_t k = source->info->mode_count;
  targets->mixes = k;
  for (size_t i = 0; i < k; ++i) {
    targets->mix[i * k + i] = 1;
  }
  memcpy(targets->modes, source->modes, k * source->terms * sizeof *targets->modes);
}

/* The gains as s + t bend, of the axes that bend least and most. */
static void split_gains(const double bend[3], const double gains[3], double *s, double *t) {
  size_t low = 0;
  size_t high = 0;
  for (size_t axis = 1; axis < 3; ++axis) {
    low = bend[axis] < bend[low] ? axis : low;
    high = bend[axis] > bend[high] ? axis : high;
  }
  *t = low == high ? 0 : (gains[high] - gains[low]) / (bend[high] - bend[low]);
  *s = gains[low] - *t * bend[low];
}

supine_status supine_export_targets_at(const export_source *source, const export_breath *breath,
                                       const export_targets *targets, const double g[3],
                                       double fraction, export_pose *pose, supine_error *error) {
  const size_t terms = source->terms;
  double y[(SUPINE_SH_BAND_MAX + 1) * (SUPINE_SH_BAND_MAX + 1)];
  double gain[2];
  const supine_status status =
      supine_export_breath_pose(source, breath, g, fraction, &pose->basis, error);
  if (status != SUPINE_OK) {
    supine_pose_fill(&pose->basis, 0);
  }
  (void)supine_sh_evaluate(source->info->band, g, y);
  split_gains(source->info->bend, pose->basis.gains[0], &gain[0], &gain[1]);
  for (size_t j = 0; j < targets->count; ++j) {
    const double *mode = targets->modes + j % targets->mixes * terms;
    double sum = 0;
    for (size_t t = 0; t < terms; ++t) {
      sum += mode[t] * y[t];
    }
    pose->weights[j] = (gain[j / targets->mixes] * sum - targets->offset[j]) / targets->unit[j];
  }
  return status;
}

/* Least and largest weight of each target over directions and the breath, the reference surface
 * included. As the scale goes one way with the volume, the breath's two ends are the extremes. */
static supine_status find_ranges(const export_source *source, const export_breath *breath,
                                 const export_targets *targets, double *low, double *high,
                                 supine_error *error) {
  export_pose pose;
  for (size_t i = 0; i < 2 * (size_t)DIRECTIONS; ++i) {
    double g[3];
    supine_spiral((double)(i / 2), DIRECTIONS, 0, g);
    const supine_status status =
        supine_export_targets_at(source, breath, targets, g, (double)(i % 2), &pose, error);
    if (status != SUPINE_OK) {
      return status;
    }
    for (size_t j = 0; j < targets->count; ++j) {
      low[j] = fmin(low[j], pose.weights[j]);
      high[j] = fmax(high[j], pose.weights[j]);
    }
  }
  return SUPINE_OK;
}

static double range_unit(double range) {
  return range > 0 ? range : 1;
}

/* Weights from 0 to 1: shifts the base, rescales the targets. */
static void fit_ranges(const double *low, const double *high, bool shift, export_targets *targets) {
  for (size_t j = 0; j < targets->count; ++j) {
    const double extra = margin * (high[j] - low[j]);
    if (shift) {
      targets->offset[j] = low[j] - extra;
      targets->unit[j] = range_unit(high[j] - low[j] + 2 * extra);
    } else {
      targets->unit[j] = range_unit(fmax(high[j], -low[j]));
    }
  }
}

/* sum += factor * mix[:, j] . u */
static void add_mix(const export_source *source, const export_targets *targets, size_t j,
                    double factor, size_t vertex, double sum[3]) {
  const size_t k = source->info->mode_count;
  const size_t mix = j % targets->mixes;
  const size_t first = targets->mixed ? 0 : mix;
  const size_t last = targets->mixed ? k : mix + 1;
  for (size_t a = first; a < last; ++a) {
    const double amount = factor * targets->mix[a * targets->mixes + mix];
    double u[3];
    supine_export_field(source, vertex, j < targets->mixes ? a : k + a, u);
    for (size_t axis = 0; axis < 3; ++axis) {
      sum[axis] += amount * u[axis];
    }
  }
}

/* Largest component of each target, mm. */
static void find_sizes(const export_source *source, const export_targets *targets, double *size) {
  for (size_t i = 0; i < source->info->vertex_count; ++i) {
    for (size_t j = 0; j < targets->count; ++j) {
      double sum[3] = {0, 0, 0};
      add_mix(source, targets, j, targets->unit[j], i, sum);
      for (size_t axis = 0; axis < 3; ++axis) {
        size[j] = fmax(size[j], fabs(sum[axis]));
      }
    }
  }
}

/* One count for all targets: the largest fills it, the smaller get a larger unit to fill it too, so
 * that each loses half a count of its own size at most. */
static void fit_counts(const export_source *source, export_targets *targets) {
  double size[EXPORT_TARGETS_MAX] = {0};
  double largest = 0;
  find_sizes(source, targets, size);
  for (size_t j = 0; j < targets->count; ++j) {
    largest = fmax(largest, size[j]);
  }
  for (size_t j = 0; j < targets->count; ++j) {
    targets->unit[j] *= size[j] > 0 ? largest / size[j] : 1;
  }
  targets->count_mm = largest > 0 ? largest / COUNT_MAX : 1;
}

supine_status supine_export_targets_choose(const export_source *source,
                                           const export_glb_options *options,
                                           export_targets *targets, supine_error *error) {
  double low[EXPORT_TARGETS_MAX] = {0};
  double high[EXPORT_TARGETS_MAX] = {0};
  export_targets made = {.count_mm = 1};
  supine_status status = SUPINE_OK;
  if (!allocate(source, &made)) {
    status = supine_error_set(error, SUPINE_ERROR_MEMORY, "out of memory");
    goto cleanup;
  }
  const size_t k = source->info->mode_count;
  const size_t halves = source->bent && 2 * k <= EXPORT_POSES ? 2 : 1;
  if (options->eight && halves * k > EIGHT) {
    status = supine_export_targets_reduce(source, EIGHT / halves, &made, error);
  } else {
    keep_modes(source, &made);
  }
  made.count = halves * made.mixes;
  for (size_t j = 0; j < made.count; ++j) {
    made.unit[j] = 1;
  }
  if (status == SUPINE_OK && (options->clamp_safe || options->quantise)) {
    status = find_ranges(source, &options->breath, &made, low, high, error);
    fit_ranges(low, high, options->clamp_safe, &made);
  }
  if (status == SUPINE_OK && options->quantise) {
    fit_counts(source, &made);
  }
cleanup:
  if (status != SUPINE_OK) {
    supine_export_targets_free(&made);
  }
  *targets = made;
  return status;
}

void supine_export_targets_fill(const export_source *source, const export_targets *targets,
                                size_t j, float *xyz) {
  for (size_t i = 0; i < source->info->vertex_count; ++i) {
    double sum[3] = {0, 0, 0};
    add_mix(source, targets, j, targets->unit[j] / targets->count_mm, i, sum);
    for (size_t axis = 0; axis < 3; ++axis) {
      xyz[3 * i + axis] = (float)sum[axis];
    }
  }
}

void supine_export_targets_base(const export_source *source, const export_targets *targets,
                                float *xyz) {
  for (size_t i = 0; i < source->info->vertex_count; ++i) {
    double sum[3] = {0, 0, 0};
    for (size_t j = 0; j < targets->count; ++j) {
      if (targets->offset[j] != 0) {
        add_mix(source, targets, j, targets->offset[j], i, sum);
      }
    }
    for (size_t axis = 0; axis < 3; ++axis) {
      const double rest = (double)source->vertices[3 * i + axis];
      xyz[3 * i + axis] = (float)((rest + sum[axis]) / targets->count_mm);
    }
  }
}
