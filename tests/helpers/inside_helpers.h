/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Synthetic basis files of one or two irregular lungs, with displacements known in closed form. */
#ifndef SUPINE_INSIDE_HELPERS_H
#define SUPINE_INSIDE_HELPERS_H

#include "tests/helpers/test.h"

#include <supine/runtime.h>
#include <supine/safetensors.h>

#include "tests/helpers/lungs_helpers.h"

enum { HELPER_MODES = 3 };

/* Compute the displacement u, mm, of a mode at a point. Mode 0 is affine, mode 1 is quadratic, and
 * mode 2 is a wave with a wavelength of about 60 mm. */
static inline void helper_motion(int mode, const double p[3], double u[3]) {
  if (mode == 0) {
    u[0] = 0.11 * p[0] - 0.07 * p[1] + 0.013 * p[2] + 2.7;
    u[1] = -0.05 * p[0] - 0.09 * p[1] + 0.021 * p[2] - 1.3;
    u[2] = 0.02 * p[0] + 0.12 * p[1] + 0.15 * p[2] + 5.9;
  } else if (mode == 1) { /* moves a lung by at most about 20 mm */
    u[0] = 6e-4 * p[0] * p[1] + 3e-4 * p[2] * p[2];
    u[1] = -5e-4 * p[1] * p[1] + 2e-4 * p[0] * p[2];
    u[2] = 8e-4 * p[2] * p[2] - 4e-4 * p[0] * p[1];
  } else {
    u[0] = 3.0 * sin(p[1] / 9.7);
    u[1] = 2.0 * sin(p[2] / 9.1 + 0.4);
    u[2] = 2.5 * cos(p[0] / 9.9 - p[1] / 31.0);
  }
}

/* Write a basis of synthetic lungs whose modes change the volume `slope` times as fast as usual.
 * The other arguments are those of helper_write_scanned_basis. */
static inline void helper_write_sloped_basis(const char *path, size_t frequency, size_t lungs,
                                             const char *scan_gravity, const char *scan_volume,
                                             double slope) {
  supine_mesh mesh[2] = {helper_lump(frequency, 71.3, 3), helper_lump(frequency, -72.9, 4)};
  const size_t n = lungs * mesh[0].vertex_count;
  const size_t m = lungs * mesh[0].triangle_count;
  float *vertices = malloc(3 * n * sizeof *vertices);
  float *coefficients = malloc(3 * n * HELPER_MODES * sizeof *coefficients);
  uint32_t *triangles = malloc(3 * m * sizeof *triangles);
  unsigned char *lung = malloc(n);
  for (size_t i = 0; i < n; ++i) {
    const size_t side = i / mesh[0].vertex_count;
    double p[3];
    for (size_t k = 0; k < 3; ++k) {
      vertices[3 * i + k] = (float)mesh[side].vertices[3 * (i % mesh[0].vertex_count) + k];
      p[k] = (double)vertices[3 * i + k];
    }
    lung[i] = (unsigned char)side;
    for (int mode = 0; mode < HELPER_MODES; ++mode) {
      double u[3];
      helper_motion(mode, p, u);
      /* For the second lung, the displacement is multiplied by -0.7. */
      for (size_t k = 0; k < 3; ++k) {
        coefficients[(3 * i + k) * HELPER_MODES + (size_t)mode] =
            (float)(side == 0 ? u[k] : -0.7 * u[k]);
      }
    }
  }
  for (size_t i = 0; i < 3 * m; ++i) {
    const size_t side = i / (3 * mesh[0].triangle_count);
    triangles[i] = mesh[side].triangles[i % (3 * mesh[0].triangle_count)] +
                   (uint32_t)(side * mesh[0].vertex_count);
  }
  double modes[HELPER_MODES * 4] = {0};
  for (size_t k = 0; k < HELPER_MODES; ++k) {
    modes[4 * k] = 0.5 + 0.1 * (double)k;
    modes[4 * k + 1] = 0.3;
  }
  double linear[2 * 3 * HELPER_MODES] = {0}; /* on the first axis alone */
  double quadratic[2 * 3 * HELPER_MODES * HELPER_MODES] = {0};
  double cubic[2 * HELPER_MODES * HELPER_MODES * HELPER_MODES] = {0};
  for (size_t i = 0; i < (size_t)2 * HELPER_MODES; ++i) {
    linear[i / HELPER_MODES * 3 * HELPER_MODES + i % HELPER_MODES] =
        slope * (200.0 + 10.0 * (double)i);
  }
  const supine_tensor tensors[] = {
      {"vertices", SUPINE_F32, 2, {n, 3}, vertices},
      {"triangles", SUPINE_U32, 2, {m, 3}, triangles},
      {"lung", SUPINE_U8, 1, {n}, lung},
      {"coefficients", SUPINE_F32, 3, {n, 3, HELPER_MODES}, coefficients},
      {"modes", SUPINE_F64, 3, {HELPER_MODES, 4, 1}, modes},
      {"volume_linear", SUPINE_F64, 3, {lungs, 3, HELPER_MODES}, linear},
      {"volume_quadratic", SUPINE_F64, 4, {lungs, 3, HELPER_MODES, HELPER_MODES}, quadratic},
      {"volume_cubic", SUPINE_F64, 4, {lungs, HELPER_MODES, HELPER_MODES, HELPER_MODES}, cubic},
  };
  const supine_metadata metadata[] = {{"format", "supine-basis"},
                                      {"version", "4"},
                                      {"kind", "vector"},
                                      {"lungs", lungs == 2 ? "left,right" : "left"},
                                      {"a key of tomorrow", "kept"},
                                      {"scan_gravity", scan_gravity},
                                      {"scan_volume_ml", scan_volume}};
  const size_t metadata_count = sizeof metadata / sizeof *metadata - (scan_volume == NULL ? 2 : 0);
  supine_error error;
  if (supine_safetensors_write(path, tensors, sizeof tensors / sizeof *tensors, metadata,
                               metadata_count, &error) != SUPINE_OK) {
    fail_msg("%s", error.message);
  }
  free(vertices);
  free(coefficients);
  free(triangles);
  free(lung);
  supine_mesh_free(&mesh[0]);
  supine_mesh_free(&mesh[1]);
}

/* Write a basis of synthetic lungs. `scan_gravity` is the direction of gravity in the scan, and
 * `scan_volume` the volume in the scan minus that of the reference surface, mL, both as text for
 * the metadata. If both are NULL, the reference surface is the scan.
 * @param frequency  each lung has 10 frequency^2 + 2 vertices */
static inline void helper_write_scanned_basis(const char *path, size_t frequency, size_t lungs,
                                              const char *scan_gravity, const char *scan_volume) {
  helper_write_sloped_basis(path, frequency, lungs, scan_gravity, scan_volume, 1.0);
}

static inline void helper_write_basis(const char *path, size_t frequency, size_t lungs) {
  helper_write_scanned_basis(path, frequency, lungs, NULL, NULL);
}

/* Open a basis without rounding the numbers of the file. */
static inline supine_basis *helper_open(const char *path) {
  const supine_basis_options exact = {.size = sizeof exact, .storage = SUPINE_STORAGE_EXACT};
  supine_basis *basis = NULL;
  supine_error error;
  if (supine_basis_open_with(path, &exact, &basis, &error) != SUPINE_OK) {
    fail_msg("%s", error.message);
  }
  return basis;
}

#endif
