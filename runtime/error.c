/* SPDX-License-Identifier: MIT */
/* Bound the error that quantisation and rounding cause in positions, mm. */
#include <math.h>

#include "runtime/internal.h"

double supine_basis_error(const supine_basis *basis, const supine_pose *pose) {
  const double unit = 0x1p-24; /* largest relative rounding error of a float */
  const size_t modes = basis->info.mode_count;
  double stored = 0;
  double moved = 0;
  for (size_t lung = 0; lung < basis->info.lung_count; ++lung) {
    const double *weights = supine_basis_lung_weights(basis, pose, lung);
    double error = 0;
    double size = 0;
    for (size_t k = 0; k < modes; ++k) {
      error += fabs(weights[k]) * basis->mode_error[k];
      size += fabs(weights[k]) * basis->mode_size[k];
    }
    stored = fmax(stored, error);
    moved = fmax(moved, size);
  }
  double scale = 0;
  for (size_t i = 0; i < 3 * basis->info.lung_count; ++i) {
    scale = fmax(scale, fabs(pose->gains[i / 3][i % 3]));
  }
  /* A displacement undergoes at most modes + 8 roundings: in packing, in the scaling of the weights
   * and in the sum over the modes. Adding the reference position rounds once more. */
  const double rounding =
      ((double)modes + 8) * unit * scale * moved + unit * (basis->reference_size + scale * moved);
  /* An expansion multiplies all errors, and rounds once more. */
  const double expansion = supine_basis_expansion(basis, pose);
  const double size = basis->reference_size + scale * moved;
  const double expanded = expansion > 0 ? 2 * unit * (1 + 2 * expansion) * size : 0;
  return supine_basis_has_pose(basis, pose)
             ? 1.001 * ((1 + expansion) * (scale * stored + basis->reference_error + rounding) +
                        expanded)
             : INFINITY;
}

static double largest_displacement(const supine_basis *basis, const supine_pose *pose) {
  enum { BLOCK = 1024 };
  float xyz[3 * BLOCK];
  const size_t n = basis->info.vertex_count;
  float top = 0;
  for (size_t begin = 0; begin < n; begin += BLOCK) {
    const size_t end = n - begin < BLOCK ? n : begin + BLOCK;
    (void)supine_displace_range(basis, pose, begin, end, xyz);
    for (size_t i = 0; i < end - begin; ++i) {
      const float *u = xyz + 3 * i;
      const float square = u[0] * u[0] + u[1] * u[1] + u[2] * u[2];
      top = square > top ? square : top;
    }
  }
  return sqrt((double)top);
}

double supine_basis_storage_error(const supine_basis *basis) {
  static const double volume = 500;  /* volume added to the reference surface, mL */
  static const double distance = 20; /* open surfaces are displaced by at most this, mm */
  double worst = 0;
  for (int number = 0; number < 27; ++number) {
    supine_pose pose = {.basis = 0};
    const int cell[3] = {number % 3 - 1, number / 3 % 3 - 1, number / 9 - 1};
    const supine_state state = {.gravity = {cell[0], cell[1], cell[2]}};
    if (basis->info.order > 0) { /* in the default volume */
      if (supine_basis_pose(basis, &state, &pose, NULL) != SUPINE_OK) {
        continue;
      }
    } else if (supine_basis_weights(basis, state.gravity, pose.weights) == SUPINE_OK) {
      supine_pose_fill(&pose, 1);
    } else {
      continue; /* the zero vector has no direction */
    }
    if (!basis->info.has_volume && !basis->info.is_fields) {
      const double largest = largest_displacement(basis, &pose);
      supine_pose_fill(&pose, largest > 0 ? distance / largest : 0);
    } else if (!basis->info.is_fields &&
               supine_basis_add_volume(basis, volume, &pose) != SUPINE_OK) {
      continue; /* the lungs cannot hold this volume in this posture */
    }
    const double error = supine_basis_error(basis, &pose);
    worst = isnan(error) ? INFINITY : fmax(worst, error); /* NaN means that floats overflowed */
  }
  return worst;
}
