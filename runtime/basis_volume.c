/* SPDX-License-Identifier: MIT */
/* Exact volumes of a basis, from its forms in the weights. */
#include <string.h>

#include <supine/sh.h>
#include <supine/volume.h>

#include "runtime/internal.h"

static void add_lung(const supine_basis *basis, size_t lung, const double *weights,
                     double cubic[3]) {
  const size_t k = basis->info.mode_count;
  supine_volume_add(k, basis->info.volume_linear + lung * k,
                    basis->info.volume_quadratic + lung * k * k,
                    basis->info.volume_cubic + lung * k * k * k, weights, cubic);
}

static supine_status need_volume(const supine_basis *basis, supine_error *error) {
  return basis->info.has_volume
             ? SUPINE_OK
             : supine_error_set(error, SUPINE_ERROR_OPEN_SURFACE,
                                "the basis has no volumes, as its surface is open: give a breath "
                                "scale instead, or close the mesh");
}

void supine_basis_lung_cubic(const supine_basis *basis, size_t lung, const double *weights,
                             double cubic[3]) {
  memset(cubic, 0, 3 * sizeof *cubic);
  add_lung(basis, lung, weights, cubic);
}

void supine_basis_cubic(const supine_basis *basis, const double *weights, double cubic[3]) {
  memset(cubic, 0, 3 * sizeof *cubic);
  for (size_t i = 0; i < basis->info.lung_count; ++i) {
    add_lung(basis, i, weights, cubic);
  }
}

double supine_basis_lung_volume(const supine_basis *basis, size_t lung, const double *weights,
                                double scale) {
  double cubic[3];
  supine_basis_lung_cubic(basis, lung, weights, cubic);
  return supine_volume_at(cubic, scale);
}

supine_status supine_basis_scale(const supine_basis *basis, const double *weights, double volume,
                                 double *scale, supine_error *error) {
  const supine_status status = need_volume(basis, error);
  if (status != SUPINE_OK) {
    return status;
  }
  double cubic[3];
  supine_basis_cubic(basis, weights, cubic);
  return supine_volume_scale(cubic, volume, scale, error);
}

supine_status supine_basis_lung_scale(const supine_basis *basis, size_t lung, const double *weights,
                                      double volume, double *scale, supine_error *error) {
  const supine_status status = need_volume(basis, error);
  if (status != SUPINE_OK) {
    return status;
  }
  if (lung >= basis->info.lung_count) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT, "lung %zu of %zu", lung,
                            basis->info.lung_count);
  }
  double cubic[3];
  supine_basis_lung_cubic(basis, lung, weights, cubic);
  return supine_volume_scale(cubic, volume, scale, error);
}

supine_status supine_basis_resting_volume(const supine_basis *basis, const double gravity[3],
                                          double *volume) {
  double y[RESTING_TERMS];
  const supine_status status = supine_sh_evaluate(2, gravity, y);
  *volume = 0.0;
  for (size_t t = 0; status == SUPINE_OK && basis->info.resting_volume != NULL && t < RESTING_TERMS;
       ++t) {
    *volume += basis->info.resting_volume[t] * y[t];
  }
  return status;
}
