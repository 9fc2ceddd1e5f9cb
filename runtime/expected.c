/* SPDX-License-Identifier: MIT */
/* Compute the expected errors of predicted positions. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "runtime/expected.h"

/* Standard deviation of an assumed volume at rest, as a fraction of the reference volume. */
static const double resting_spread = 0.05;
const double supine_expected_shift = 0.01;

double supine_expected_constant(const supine_basis *basis) {
  const char *text = supine_basis_metadata(basis, "expected_error_mm");
  const double stated = text == NULL ? 0 : strtod(text, NULL);
  return stated > 0 && isfinite(stated) ? stated : SUPINE_EXPECTED_ERROR_MM;
}

double supine_expected_reference(const supine_basis *basis) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  double sum = 0;
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    sum += info->reference_volume[lung];
  }
  return sum;
}

double supine_expected_rms(const supine_basis *basis, const supine_pose *pose,
                           const supine_pose *from) {
  const size_t n = supine_basis_get_info(basis)->vertex_count;
  float x[3 * LOCATE_BLOCK];
  float origin[3 * LOCATE_BLOCK];
  double sum = 0;
  for (size_t begin = 0; begin < n; begin += LOCATE_BLOCK) {
    const size_t end = n - begin < LOCATE_BLOCK ? n : begin + LOCATE_BLOCK;
    (void)supine_displace_range(basis, pose, begin, end, x);
    (void)supine_displace_range(basis, from, begin, end, origin);
    for (size_t i = 0; i < 3 * (end - begin); ++i) {
      const double d = (double)x[i] - (double)origin[i];
      sum += d * d;
    }
  }
  return sqrt(sum / (double)n);
}

/* Return whether the basis has a volume at rest that was assumed instead of measured. */
static bool rest_is_assumed(const supine_basis *basis) {
  const char *scanned = supine_basis_metadata(basis, "scanned");
  const char *state = supine_basis_metadata(basis, "scan_state");
  return supine_basis_get_info(basis)->has_rest &&
         supine_basis_metadata(basis, "resting_known") == NULL &&
         (scanned == NULL || strcmp(scanned, "rest") != 0) &&
         (state == NULL || strstr(state, "rest") == NULL);
}

/* Return whether the volume of a state, of all lungs or of one lung, is relative to rest. */
static bool counts_from_rest(const supine_state *state) {
  bool rest = state->lung_count == 0 && (state->volume.kind == SUPINE_VOLUME_REST ||
                                         state->volume.kind == SUPINE_VOLUME_DEFAULT);
  for (size_t i = 0; i < state->lung_count; ++i) {
    rest = rest || state->lungs[i].volume.kind == SUPINE_VOLUME_REST;
  }
  return rest;
}

supine_status supine_expected_shifted(const supine_basis *basis, const supine_state *state,
                                      supine_pose *pose, supine_error *error) {
  const double ml = supine_expected_shift * supine_expected_reference(basis);
  supine_state shifted = *state;
  if (shifted.volume.kind == SUPINE_VOLUME_DEFAULT) {
    shifted.volume.kind = SUPINE_VOLUME_REST;
  }
  shifted.volume.ml += ml;
  for (size_t i = 0; i < shifted.lung_count; ++i) {
    shifted.lungs[i].volume.ml += ml / (double)shifted.lung_count;
  }
  return supine_basis_pose(basis, &shifted, pose, error);
}

/* Poses from which the expected errors of a state are computed. */
typedef struct poses {
  supine_pose at;   /* pose whose errors are computed */
  supine_pose from; /* pose whose positions are taken to be exact */
  /* Copies of `at` and `from`. If the volume of a state is relative to an assumed volume at rest,
   * its copy holds 1 % of the reference volume more. */
  supine_pose fuller_at, fuller_from;
  bool assumed; /* whether `fuller_at` or `fuller_from` holds more than its original */
} poses;

static supine_status find_poses(const supine_basis *basis, const supine_state *state,
                                const supine_state *from, poses *p, supine_error *error) {
  const bool assumed = rest_is_assumed(basis);
  supine_status status = supine_basis_pose(basis, state, &p->at, error);
  if (status == SUPINE_OK) {
    status = supine_basis_pose(basis, from, &p->from, error);
  }
  p->fuller_at = p->at;
  p->fuller_from = p->from;
  p->assumed = assumed && (counts_from_rest(state) || counts_from_rest(from));
  if (status == SUPINE_OK && assumed && counts_from_rest(state)) {
    status = supine_expected_shifted(basis, state, &p->fuller_at, error);
  }
  if (status == SUPINE_OK && assumed && counts_from_rest(from)) {
    status = supine_expected_shifted(basis, from, &p->fuller_from, error);
  }
  return status;
}

/* Compute the expected errors of at most LOCATE_BLOCK vertices, begin <= i < end, mm. */
static void fill_block(const supine_basis *basis, const poses *p, double constant, size_t begin,
                       size_t end, float *sigma) {
  const supine_pose *const of[4] = {&p->at, &p->from, &p->fuller_at, &p->fuller_from};
  float x[4][3 * LOCATE_BLOCK];
  for (size_t k = 0; k < (p->assumed ? 4U : 2U); ++k) {
    (void)supine_displace_range(basis, of[k], begin, end, x[k]);
  }
  for (size_t i = 0; i < end - begin; ++i) {
    double moved = 0;
    double slope = 0;
    for (size_t j = 3 * i; j < 3 * i + 3; ++j) {
      const double u = (double)x[0][j] - (double)x[1][j];
      const double fuller = p->assumed ? (double)x[2][j] - (double)x[3][j] - u : 0;
      moved += u * u;
      slope += fuller * fuller;
    }
    const double rest = resting_spread / supine_expected_shift;
    sigma[begin + i] = (float)sqrt(sqrt(moved) * constant + slope * rest * rest);
  }
}

supine_status supine_expected_error(const supine_basis *basis, const supine_state *state,
                                    const supine_state *from, float *sigma, supine_error *error) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  const supine_state scan = supine_basis_scan(basis);
  poses p;
  if (info->is_fields) {
    return supine_error_set(
        error, SUPINE_ERROR_UNSUPPORTED,
        "the basis holds another simulator's displacements, whose error is unknown");
  }
  const supine_status status = find_poses(basis, state, from == NULL ? &scan : from, &p, error);
  if (status != SUPINE_OK) {
    return status;
  }
  const double rms = supine_expected_rms(basis, &p.at, &p.from);
  const double constant = fmin(supine_expected_constant(basis), rms);
  for (size_t begin = 0; begin < info->vertex_count; begin += LOCATE_BLOCK) {
    const size_t left = info->vertex_count - begin;
    fill_block(basis, &p, constant, begin, begin + (left < LOCATE_BLOCK ? left : LOCATE_BLOCK),
               sigma);
  }
  return SUPINE_OK;
}
