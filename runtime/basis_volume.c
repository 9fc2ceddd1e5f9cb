/* SPDX-License-Identifier: MIT */
/* Check what a basis file knows of the volumes of the lungs, and of the scan. */
#include <math.h>
#include <string.h>

#include <supine/sh.h>

#include "base/arena.h"
#include "runtime/basis_check.h"
#include "runtime/checks.h"
#include "runtime/lung.h"
#include "runtime/simulated.h"

/* Check the tensors volume_linear, volume_quadratic and volume_cubic. Either all or none must
 * exist. */
static supine_status check_volume(const supine_check *c, supine_basis *basis) {
  supine_basis_info *info = &basis->info;
  const size_t g = info->lung_count;
  const size_t k = info->mode_count;
  size_t by_axis[] = {g, 3, k, k};
  size_t cubic[] = {g, k, k, k};
  static const char *const names[] = {"volume_linear", "volume_quadratic", "volume_cubic"};
  for (size_t i = 0; i < 3; ++i) {
    info->has_volume = info->has_volume || supine_safetensors_find(c->file, names[i]) != NULL;
  }
  if (!info->has_volume) {
    return SUPINE_OK;
  }
  REQUIRE(info->volume_linear, c, names[0], SUPINE_F64, 3, by_axis);
  REQUIRE(info->volume_quadratic, c, names[1], SUPINE_F64, 4, by_axis);
  REQUIRE(info->volume_cubic, c, names[2], SUPINE_F64, 4, cubic);
  return SUPINE_OK;
}

/* For each lung, add the volume that the reference surface encloses, mL, to `reference_volume`. */
static void measure_lungs(supine_basis *basis) {
  const supine_basis_info *info = &basis->info;
  for (size_t t = 0; t < info->triangle_count; ++t) {
    const size_t lung = supine_basis_lung_of(info, info->triangles[3 * t]);
    const float *origin = info->vertices + 3 * info->lung_begin[lung];
    double p[3][3];
    for (size_t i = 0; i < 9; ++i) {
      const size_t corner = info->triangles[3 * t + i / 3];
      p[i / 3][i % 3] = (double)info->vertices[3 * corner + i % 3] - (double)origin[i % 3];
    }
    for (size_t i = 0; i < 3; ++i) {
      const size_t j = (i + 1) % 3;
      const size_t k = (i + 2) % 3;
      basis->reference_volume[lung] += 1e-3 / 6 * p[0][i] * (p[1][j] * p[2][k] - p[1][k] * p[2][j]);
    }
  }
}

/* Set the volume of the reference surface of each lung, mL. Measure the volume, unless the file was
 * made by 'supine embed': such a file lacks this surface and has the volume in its metadata. */
static supine_status check_reference(const supine_check *c, supine_basis *basis) {
  basis->info.reference_volume = basis->reference_volume;
  if (!basis->info.has_volume) {
    return SUPINE_OK;
  }
  if (supine_safetensors_metadata(c->file, "content") == NULL ||
      supine_safetensors_metadata(c->file, "reference_volume_ml") == NULL) {
    measure_lungs(basis);
    return SUPINE_OK;
  }
  return supine_check_read(c, "reference_volume_ml", basis->info.lung_count,
                           basis->reference_volume);
}

/* Check the optional tensors 'resting_volume' and 'full_volume': spherical-harmonic coefficients of
 * the volumes of each lung at rest and, of simulated volumes, at full inflation. */
static supine_status check_rest(const supine_check *c, supine_basis *basis) {
  size_t shape[2] = {basis->info.lung_count, RESTING_TERMS};
  if (supine_safetensors_find(c->file, "resting_volume") != NULL) {
    REQUIRE(basis->resting, c, "resting_volume", SUPINE_F64, 2, shape);
    basis->info.has_rest = true;
  }
  if (supine_safetensors_find(c->file, "full_volume") != NULL) {
    REQUIRE(basis->simulated.full, c, "full_volume", SUPINE_F64, 2, shape);
  }
  return SUPINE_OK;
}

/* Check the optional tensor 'volume_range': the volumes that each lung can hold. */
static supine_status check_range(const supine_check *c, supine_basis *basis) {
  if (supine_safetensors_find(c->file, "volume_range") == NULL) {
    return SUPINE_OK;
  }
  size_t shape[3] = {SUPINE_RANGE_NODES, basis->info.lung_count, 2};
  REQUIRE(basis->volume_range, c, "volume_range", SUPINE_F64, 3, shape);
  return SUPINE_OK;
}

/* Read the metadata about the scan and about full inflation. If the posture and volume in the scan
 * are missing, assume supine and the volume of the reference surface. */
static supine_status check_scan(const supine_check *c, supine_basis *basis) {
  const char *volume = supine_safetensors_metadata(c->file, "scan_volume_ml");
  const char *scanned = supine_safetensors_metadata(c->file, "scanned");
  const char *route = supine_safetensors_metadata(c->file, "route");
  double by_lung[SUPINE_LUNGS_MAX] = {0};
  const size_t count = volume != NULL && strchr(volume, ',') != NULL ? basis->info.lung_count : 1;
  basis->scan_gravity[1] = 1;
  basis->info.is_fields = route != NULL && strcmp(route, "fields") == 0;
  basis->info.has_full = basis->info.has_rest || (scanned != NULL && strcmp(scanned, "full") == 0);
  if (supine_check_read(c, "scan_volume_ml", count, by_lung) != SUPINE_OK ||
      supine_check_read(c, "scan_gravity", 3, basis->scan_gravity) != SUPINE_OK ||
      supine_check_read(c, "full_upright_gain", 1, &basis->upright_gain) != SUPINE_OK ||
      supine_check_read(c, "bend", 3, basis->info.bend) != SUPINE_OK) {
    return SUPINE_ERROR_FORMAT;
  }
  for (size_t i = 0; i < count; ++i) {
    basis->scan_volume += by_lung[i];
  }
  if (supine_safetensors_metadata(c->file, "bend") != NULL && !basis->info.has_rest) {
    return supine_check_refuse(c, "metadata 'bend' requires a tensor 'resting_volume'");
  }
  return SUPINE_OK;
}

/* Check the tensors and metadata of fields that depend on volume. Only they know full inflation by
 * a tensor of its own. */
static supine_status check_simulated(const supine_check *c, supine_basis *basis) {
  const size_t lungs = basis->info.lung_count;
  supine_simulated *s = &basis->simulated;
  size_t range[] = {lungs, 2};
  size_t limits[] = {lungs, 2, ANY};
  size_t shares[] = {lungs, RESTING_TERMS, ANY};
  if (basis->info.order == 0) {
    return SUPINE_OK;
  }
  REQUIRE(s->range, c, "simulated_range", SUPINE_F64, 2, range);
  REQUIRE(s->limits, c, "simulated_limits", SUPINE_F64, 3, limits);
  REQUIRE(s->shares, c, "simulated_shares", SUPINE_F64, 3, shares);
  s->share_count = shares[2];
  s->limit_terms = limits[2];
  size_t band = 0;
  while (band < LIMIT_BAND_MAX && supine_sh_count(band) < s->limit_terms) {
    ++band;
  }
  if (supine_sh_count(band) != s->limit_terms) {
    return supine_check_refuse(c, "tensor 'simulated_limits' has harmonics that are not complete");
  }
  basis->info.is_fields = true;
  basis->info.has_full = s->full != NULL;
  SUPINE_TRY(supine_check_read(c, "simulated_total_ml", 2, s->total));
  bool rising = s->total[0] < s->total[1];
  for (size_t lung = 0; lung < lungs; ++lung) {
    rising = rising && s->range[2 * lung] < s->range[2 * lung + 1];
  }
  if (!rising || s->share_count < 1 || s->share_count > SUPINE_SH_ORDER_MAX + 1 ||
      !basis->info.has_volume) {
    return supine_check_refuse(c,
                               "the simulated volumes have no range, or the surface has no volume");
  }
  if (supine_safetensors_metadata(c->file, "scan_gravity") != NULL &&
      supine_simulated_find_offsets(basis, s->offset) != SUPINE_OK) {
    return supine_check_refuse(c, "metadata 'scan_gravity' is not a direction");
  }
  return supine_simulated_find_default(basis, &s->usual);
}

/* Read the optional metadata about lungs that the file holds as collapsed: the factor on their
 * lengths in the scan minus 1, and the hilum about which they have shrunk, which moves. */
static supine_status check_collapse(const supine_check *c, supine_basis *basis) {
  static const double most = 100;
  const size_t count = basis->info.lung_count;
  if (supine_safetensors_metadata(c->file, "lung_hilum_mm") == NULL) {
    return SUPINE_OK;
  }
  SUPINE_TRY(supine_check_read(c, "lung_expansion", count, basis->scan_expansion));
  SUPINE_TRY(supine_check_read(c, "lung_hilum_mm", 3 * count, basis->hilum[0]));
  bool good = supine_pose_is_finite(basis->hilum[0], 3 * count);
  for (size_t lung = 0; lung < count; ++lung) {
    good = good && basis->scan_expansion[lung] >= 0 && basis->scan_expansion[lung] <= most;
  }
  if (!good) {
    return supine_check_refuse(c, "metadata 'lung_expansion' or 'lung_hilum_mm' is out of range");
  }
  basis->info.hilum = basis->hilum[0];
  if (supine_safetensors_find(c->file, "lungs_hilum") != NULL) {
    size_t shape[3] = {count, 3, basis->info.mode_count};
    REQUIRE(basis->hilum_modes, c, "lungs_hilum", SUPINE_F64, 3, shape);
    const size_t numbers = shape[0] * shape[1] * shape[2];
    if (!supine_pose_is_finite(basis->hilum_modes, numbers)) {
      return supine_check_refuse(c, "tensor 'lungs_hilum' has numbers out of range");
    }
  }
  return SUPINE_OK;
}

supine_status supine_check_volumes(const supine_check *c, supine_basis *basis) {
  SUPINE_TRY(check_volume(c, basis));
  SUPINE_TRY(check_reference(c, basis));
  SUPINE_TRY(check_rest(c, basis));
  SUPINE_TRY(check_range(c, basis));
  SUPINE_TRY(check_scan(c, basis));
  SUPINE_TRY(check_simulated(c, basis));
  return check_collapse(c, basis);
}
