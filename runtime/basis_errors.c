/* SPDX-License-Identifier: MIT */
/* Check what a basis file has of expected errors: constants, a fit of landmarks, and the errors of
 * another simulator's fields. */
#include <math.h>
#include <string.h>

#include <supine/sh.h>

#include "base/arena.h"
#include "base/number.h"
#include "runtime/basis_check.h"
#include "runtime/kriging.h"

/* Check the optional tensors from which the expected errors of embedded points are computed: the
 * box around the lungs, and the mean products of the coefficients of their vertices. */
static supine_status check_expected(const supine_check *c, supine_basis *basis) {
  const size_t k = basis->info.mode_count;
  size_t corners[] = {2, 3};
  size_t products[] = {basis->info.lung_count, 3, k, k};
  if (supine_safetensors_find(c->file, "lungs_squares") != NULL) {
    const double *box = NULL;
    REQUIRE(box, c, "lungs_box", SUPINE_F64, 2, corners);
    REQUIRE(basis->squares, c, "lungs_squares", SUPINE_F64, 4, products);
    memcpy(basis->box, box, sizeof basis->box);
  }
  basis->midline = 0.5 * (basis->box[0][0] + basis->box[1][0]);
  return supine_check_read(c, "midline_mm", 1, &basis->midline);
}

/* Check the optional metadata with the constants of expected errors (expected.c). */
static supine_status check_constants(const supine_check *c) {
  static const char *const keys[] = {"expected_error_mm", "expected_error_from_mm",
                                     "resting_spread"};
  static const double most = 1e3;
  for (size_t i = 0; i < sizeof keys / sizeof *keys; ++i) {
    double value = 1;
    SUPINE_TRY(supine_check_read(c, keys[i], 1, &value));
    if (!(value > 0 && value <= most)) {
      return supine_check_refuse(c, "metadata '%s' is %g: it must be above 0 and at most %g",
                                 keys[i], value, most);
    }
  }
  return SUPINE_OK;
}

/* Check the optional tensor 'error_volume' of another simulator's fields over volume. */
static supine_status check_volume_errors(const supine_check *c, supine_basis *basis) {
  size_t count = ANY;
  if (basis->info.order == 0 || supine_safetensors_find(c->file, "error_volume") == NULL) {
    return SUPINE_OK;
  }
  REQUIRE(basis->error_volume, c, "error_volume", SUPINE_F64, 1, &count);
  double least = count < 2 ? -1 : 0;
  for (size_t i = 0; i < count; ++i) {
    least = fmin(least, basis->error_volume[i]);
  }
  if (least < 0) {
    return supine_check_refuse(c,
                               "tensor 'error_volume' has less than two numbers, or one below 0");
  }
  basis->error_volume_count = count;
  return SUPINE_OK;
}

/* Check the optional tensors 'error_vertices' and 'error_gravity' of another simulator's fields. */
static supine_status check_vertex_errors(const supine_check *c, supine_basis *basis) {
  size_t n = basis->info.vertex_count;
  if (!basis->info.is_fields || supine_safetensors_find(c->file, "error_vertices") == NULL) {
    return SUPINE_OK;
  }
  REQUIRE(basis->vertex_error, c, "error_vertices", SUPINE_F32, 1, &n);
  for (size_t i = 0; i < n; ++i) {
    if (!(basis->vertex_error[i] >= 0)) {
      return supine_check_refuse(c, "tensor 'error_vertices' has %g mm at vertex %zu, below 0",
                                 (double)basis->vertex_error[i], i);
    }
  }
  if (supine_safetensors_find(c->file, "error_gravity") == NULL) {
    return SUPINE_OK;
  }
  const size_t band = basis->info.band;
  size_t shape[] = {2 * band + 4, supine_sh_count(band + 1)};
  if (band > FIT_BAND_MAX) {
    return supine_check_refuse(c, "tensor 'error_gravity' belongs to band %zu, above %d", band,
                               FIT_BAND_MAX);
  }
  REQUIRE(basis->error_gravity, c, "error_gravity", SUPINE_F64, 2, shape);
  return check_volume_errors(c, basis);
}

/* Check the optional tensors of a fit of landmarks: 'landmarks' and 'error_share'. */
static supine_status check_landmarks(const supine_check *c, supine_basis *basis) {
  size_t n = basis->info.vertex_count;
  size_t landmarks[2] = {ANY, 4};
  if (supine_safetensors_find(c->file, "error_share") == NULL) {
    return SUPINE_OK;
  }
  if (supine_safetensors_find(c->file, "landmarks") != NULL) {
    REQUIRE(basis->landmarks, c, "landmarks", SUPINE_F32, 2, landmarks);
    const char *text = supine_safetensors_metadata(c->file, "expected_error_share");
    basis->landmark_count = landmarks[0];
    basis->held_out = text == NULL ? 0 : supine_number_parse(text, NULL);
    if (basis->landmark_count > SUPINE_KRIGING_LANDMARKS_MAX || !(basis->held_out > 0)) {
      return supine_check_refuse(
          c, "it has %zu landmarks, more than %d, or no share at points that were held out",
          basis->landmark_count, (int)SUPINE_KRIGING_LANDMARKS_MAX);
    }
    for (size_t i = 0; i < 4 * basis->landmark_count; ++i) {
      if (!(fabsf(basis->landmarks[i]) < 1e6F)) {
        return supine_check_refuse(c, "tensor 'landmarks' has %g in row %zu",
                                   (double)basis->landmarks[i], i / 4);
      }
    }
  }
  REQUIRE(basis->error_share, c, "error_share", SUPINE_F32, 1, &n);
  for (size_t i = 0; i < n; ++i) {
    if (!(basis->error_share[i] >= 0 && basis->error_share[i] <= 1e6F)) {
      return supine_check_refuse(c, "tensor 'error_share' has %g at vertex %zu, not 0 to 1e6",
                                 (double)basis->error_share[i], i);
    }
  }
  return SUPINE_OK;
}

supine_status supine_check_errors(const supine_check *c, supine_basis *basis) {
  SUPINE_TRY(check_expected(c, basis));
  SUPINE_TRY(check_constants(c));
  SUPINE_TRY(check_vertex_errors(c, basis));
  return check_landmarks(c, basis);
}
