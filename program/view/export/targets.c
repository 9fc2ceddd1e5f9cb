/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "program/view/export/targets.h"
#include "base/arena.h"

#include <math.h>
#include <stdlib.h>

#include "base/vec3.h"
#include "program/options/breath_turn.h"
#include "program/view/render/render.h"
#include "runtime/simulated.h"

enum { DIRECTIONS = 4096 }; /* number of sampled directions of gravity */
/* The range of each weight in the sampled directions is extended by this fraction at both ends. */
static const double margin = 0.02;

/* Compute the factor that multiplies each displacement field of a lung in a pose. */
static void find_amounts(const export_targets *targets, const supine_pose *pose, size_t lung,
                         double *amounts) {
  const size_t k = targets->info->mode_count;
  const double *bend = targets->info->bend;
  const double *gains = pose->gains[lung];
  const double *weights = supine_basis_lung_weights(targets->basis, pose, lung);
  size_t low = 0;
  size_t high = 0;
  for (size_t axis = 1; axis < 3; ++axis) {
    low = bend[axis] < bend[low] ? axis : low;
    high = bend[axis] > bend[high] ? axis : high;
  }
  /* gains[axis] = s + t bend[axis] on every axis, so that two axes suffice to find s and t. */
  const double t = low == high ? 0 : (gains[high] - gains[low]) / (bend[high] - bend[low]);
  const double s = gains[low] - t * bend[low];
  for (size_t j = 0; j < targets->count; ++j) {
    amounts[j] = (j < k ? s : t) * weights[j % k];
  }
}

/* Compute the pose at a volume of all lungs, mL above that in the scan. */
static supine_status pose_at(const supine_basis *basis, const double g[3], double ml,
                             supine_pose *pose, supine_error *error) {
  const supine_state state = {.gravity = {g[0], g[1], g[2]}, .volume = {SUPINE_VOLUME_SCAN, ml}};
  return supine_basis_pose(basis, &state, pose, error);
}

/* Compute the pose during a breath in another simulator's fields. The breath begins at rest, or in
 * the scan if rest is unknown, or as near to it as the simulated volumes allow. */
static supine_status simulated_breath(const supine_basis *basis, double breath, const double g[3],
                                      double fraction, supine_pose *pose, supine_error *error) {
  const supine_state start = supine_options_breath_state(basis, g, 0);
  double range[2];
  double begin = 0;
  SUPINE_TRY(supine_simulated_range(basis, g, SUPINE_VOLUME_SCAN, range, error));
  if (supine_basis_pose(basis, &start, pose, NULL) == SUPINE_OK) {
    double volumes[SUPINE_LUNGS_MAX];
    SUPINE_TRY(supine_basis_volumes(basis, pose, volumes));
    for (size_t lung = 0; lung < supine_basis_get_info(basis)->lung_count; ++lung) {
      begin += volumes[lung] - supine_basis_get_info(basis)->reference_volume[lung];
    }
  }
  begin = fmax(range[0], fmin(begin, range[1] - breath));
  const double total = fmin(range[1], begin + fraction * breath);
  return pose_at(basis, g, total, pose, error);
}

supine_status supine_export_breath_pose(const supine_basis *basis, double breath, const double g[3],
                                        double fraction, supine_pose *pose, supine_error *error) {
  supine_state state = supine_options_breath_state(basis, g, fraction * breath);
  if (supine_basis_get_info(basis)->order > 0) {
    return simulated_breath(basis, breath, g, fraction, pose, error);
  }
  if (supine_basis_get_info(basis)->is_fields) {
    state.volume = (supine_volume){SUPINE_VOLUME_DEFAULT, 0};
  }
  return supine_basis_pose(basis, &state, pose, error);
}

void supine_export_targets_weights(const export_targets *targets, const supine_pose *pose,
                                   size_t lung, double *weights) {
  const export_weights *w = &targets->lung[lung];
  find_amounts(targets, pose, lung, weights);
  for (size_t j = 0; j < targets->count; ++j) {
    weights[j] = (weights[j] - w->offset[j]) / w->unit[j];
  }
}

/* Compute the pose at a fraction of the volumes that the morph targets must show for a direction of
 * gravity: those of the breath or, in another simulator's fields, all that were simulated. */
static supine_status sample_pose(const export_targets *targets, const double g[3], double fraction,
                                 supine_pose *pose, supine_error *error) {
  if (targets->info->order > 0) {
    double range[2];
    SUPINE_TRY(supine_simulated_range(targets->basis, g, SUPINE_VOLUME_SCAN, range, error));
    return pose_at(targets->basis, g, range[0] + fraction * (range[1] - range[0]), pose, error);
  }
  return supine_export_breath_pose(targets->basis, targets->breath, g, fraction, pose, error);
}

/* Find the smallest and the largest factor of each displacement field in any sampled direction of
 * gravity and phase of the breath, or simulated volume. Within a large breath, some factors pass an
 * extremum; 10 steps miss it by less than `margin`. Set `offset` to the smallest factor, at which
 * the morph target has weight 0, and `unit` to the difference from the largest, at which it has
 * weight 1. */
static supine_status find_ranges(export_targets *targets, supine_error *error) {
  enum { STEPS = 10, PHASES = STEPS + 1 };
  double amounts[EXPORT_TARGETS_MAX];
  supine_pose pose;
  for (size_t i = 0; i < PHASES * (size_t)DIRECTIONS; ++i) {
    double g[3];
    supine_spiral((double)(i / PHASES), DIRECTIONS, 0, g);
    SUPINE_TRY(sample_pose(targets, g, (double)(i % PHASES) / STEPS, &pose, error));
    for (size_t lung = 0; lung < targets->info->lung_count; ++lung) {
      export_weights *w = &targets->lung[lung];
      find_amounts(targets, &pose, lung, amounts);
      for (size_t j = 0; j < targets->count; ++j) {
        const double high = i == 0 ? amounts[j] : fmax(amounts[j], w->offset[j] + w->unit[j]);
        w->offset[j] = i == 0 ? amounts[j] : fmin(amounts[j], w->offset[j]);
        w->unit[j] = high - w->offset[j];
      }
    }
  }
  return SUPINE_OK;
}

static void find_middle(export_targets *targets) {
  double low[3] = {INFINITY, INFINITY, INFINITY};
  double high[3] = {-INFINITY, -INFINITY, -INFINITY};
  supine_render_box(targets->info->vertices, targets->info->vertex_count, low, high);
  targets->half_extent = 0;
  for (size_t axis = 0; axis < 3; ++axis) {
    targets->middle[axis] = (low[axis] + high[axis]) / 2;
    targets->half_extent = fmax(targets->half_extent, (high[axis] - low[axis]) / 2);
  }
}

supine_status supine_export_targets_choose(const supine_basis *basis, double breath,
                                           export_targets *targets, supine_error *error) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  const bool bent = info->bend[0] != 0 || info->bend[1] != 0 || info->bend[2] != 0;
  targets->basis = basis;
  targets->info = info;
  targets->breath = breath;
  targets->count = (bent ? 2 : 1) * info->mode_count;
  find_middle(targets);
  SUPINE_TRY(find_ranges(targets, error));
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    export_weights *w = &targets->lung[lung];
    for (size_t j = 0; j < targets->count; ++j) {
      w->offset[j] -= margin * w->unit[j];
      w->unit[j] = w->unit[j] > 0 ? (1 + 2 * margin) * w->unit[j] : 1;
    }
  }
  return SUPINE_OK;
}

void supine_export_targets_field(const export_targets *targets, size_t vertex, size_t j,
                                 double u[3]) {
  const supine_basis_info *info = targets->info;
  const size_t k = info->mode_count;
  float vectors[3 * SUPINE_MODES_MAX];
  if (info->vector) {
    (void)supine_basis_coefficients(targets->basis, vertex, vertex + 1, vectors);
  }
  for (size_t axis = 0; axis < 3; ++axis) {
    if (info->vector) {
      u[axis] = (double)vectors[axis * k + j % k];
    } else {
      u[axis] = (double)info->coefficients[vertex * k + j % k] *
                (double)info->direction[3 * vertex + axis];
    }
    u[axis] *= j < k ? 1 : info->bend[axis];
  }
}

/* Add the displacement fields at a vertex, times `amount` [count], to the position `xyz`, mm. */
static void add_fields(const export_targets *targets, const double *amount, size_t vertex,
                       double xyz[3]) {
  for (size_t j = 0; j < targets->count; ++j) {
    double u[3];
    supine_export_targets_field(targets, vertex, j, u);
    for (size_t axis = 0; axis < 3; ++axis) {
      xyz[axis] += amount[j] * u[axis];
    }
  }
}

void supine_export_targets_base(const export_targets *targets, size_t lung, size_t vertex,
                                double xyz[3]) {
  for (size_t axis = 0; axis < 3; ++axis) {
    xyz[axis] = (double)targets->info->vertices[3 * vertex + axis] - targets->middle[axis];
  }
  add_fields(targets, targets->lung[lung].offset, vertex, xyz);
}

/* Compute the normals [N, 3] of the surface at the morph targets' `weights` in each lung. First add
 * `step` to the weight of target `j` in every lung. `xyz` [N, 3] is workspace. */
static void find_normals(const export_targets *targets, double (*weights)[EXPORT_TARGETS_MAX],
                         size_t j, double step, float *xyz, float *normals) {
  const supine_basis_info *info = targets->info;
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    double amount[EXPORT_TARGETS_MAX];
    for (size_t i = 0; i < targets->count; ++i) {
      amount[i] = targets->lung[lung].unit[i] * (weights[lung][i] + (i == j ? step : 0));
    }
    for (size_t i = info->lung_begin[lung]; i < info->lung_begin[lung + 1]; ++i) {
      double at[3];
      supine_export_targets_base(targets, lung, i, at);
      add_fields(targets, amount, i, at);
      for (size_t axis = 0; axis < 3; ++axis) {
        xyz[3 * i + axis] = (float)at[axis];
      }
    }
  }
  supine_normals(targets->basis, xyz, normals);
}

/* Divide each base normal by its length, because glTF requires unit normals. Divide the changes of
 * this normal by morph targets by the same length: viewers normalise the sum. */
static void make_unit(const export_targets *targets, float *base, float *added) {
  static const double least = 0.2; /* smallest divisor of the changes */
  const size_t n = targets->info->vertex_count;
  for (size_t i = 0; i < n; ++i) {
    float *b = base + 3 * i;
    const double length = hypot(hypot((double)b[0], (double)b[1]), (double)b[2]);
    if (length < 1e-6) { /* the vertex is in no triangle */
      b[2] = 1;
      continue;
    }
    for (size_t axis = 0; axis < 3; ++axis) {
      b[axis] = (float)((double)b[axis] / length);
      for (size_t j = 0; j < targets->count; ++j) {
        added[3 * (j * n + i) + axis] /= (float)fmax(length, least);
      }
    }
  }
}

/* Round the changes of normals by morph targets, `added`, so that they compress well: to multiples
 * of 1 / INT8_MAX, or to the value of the previous vertex in `order` if that is close. The normal
 * at the targets' `weights` is `base` plus the sum of weight times change. Correct `base`, so that
 * this normal stays as it was. */
static void round_changes(const export_targets *targets, double (*weights)[EXPORT_TARGETS_MAX],
                          const export_order *order, float *base, float *added) {
  /* A component that differs by at most this from that of the previous vertex becomes equal. */
  static const float near = 2.0F / INT8_MAX;
  const supine_basis_info *info = targets->info;
  for (size_t i = 0, lung = 0; i < order->vertex_count; ++i) {
    lung += i == order->lung_begin[lung + 1];
    const size_t vertex = order->vertex[i];
    float *b = base + 3 * vertex;
    for (size_t axis = 0; axis < 3; ++axis) {
      for (size_t j = 0; j < targets->count; ++j) {
        float *rows = added + 3 * j * info->vertex_count + axis;
        const float given = rows[3 * vertex];
        const float before =
            i > order->lung_begin[lung] ? rows[3 * (size_t)order->vertex[i - 1]] : 2;
        const float own = rintf(INT8_MAX * fmaxf(-1, fminf(1, given))) / INT8_MAX;
        const float kept = fabsf(given - before) <= near ? before : own;
        b[axis] += (float)weights[lung][j] * (given - kept);
        rows[3 * vertex] = kept;
      }
    }
    const float length = hypotf(hypotf(b[0], b[1]), b[2]);
    for (size_t axis = 0; axis < 3; ++axis) {
      b[axis] /= length;
    }
  }
}

supine_status supine_export_targets_normals(const export_targets *targets,
                                            const export_order *order, bool exact, float *base,
                                            float *added, supine_error *error) {
  static const double supine[3] = {0, 1, 0};
  static const double step = 0.2; /* change of a weight for central differences */
  /* Changes of a lung's normals by a morph target are set to 0 if their RMS is less, radians. */
  static const double least = 0.035;
  const supine_basis_info *info = targets->info;
  const size_t n = info->vertex_count;
  supine_pose pose;
  SUPINE_ARENA arena = {0};
  double(*weights)[EXPORT_TARGETS_MAX] =
      supine_arena_take(&arena, info->lung_count, sizeof *weights);
  float *xyz = supine_arena_take(&arena, 3 * n, sizeof *xyz);
  float *below = supine_arena_take(&arena, 3 * n, sizeof *below);
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu vertices", n));
  SUPINE_TRY(supine_export_breath_pose(targets->basis, targets->breath, supine, 0, &pose, error));
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    supine_export_targets_weights(targets, &pose, lung, weights[lung]);
  }
  find_normals(targets, weights, 0, 0, xyz, base);
  for (size_t j = 0; j < targets->count; ++j) {
    float *d = added + 3 * j * n;
    find_normals(targets, weights, j, step, xyz, d);
    find_normals(targets, weights, j, -step, xyz, below);
    for (size_t lung = 0; lung < info->lung_count; ++lung) {
      const size_t begin = 3 * info->lung_begin[lung];
      const size_t end = 3 * info->lung_begin[lung + 1];
      double sum = 0;
      for (size_t i = begin; i < end; ++i) {
        d[i] = (d[i] - below[i]) / (float)(2 * step);
        sum += (double)d[i] * (double)d[i];
      }
      const bool seen = exact || sum > least * least * (double)(end - begin) / 3;
      for (size_t i = begin; i < end; ++i) {
        d[i] = seen ? d[i] : 0;
        base[i] -= (float)weights[lung][j] * d[i];
      }
    }
  }
  make_unit(targets, base, added);
  if (!exact) {
    round_changes(targets, weights, order, base, added);
  }
  return SUPINE_OK;
}
