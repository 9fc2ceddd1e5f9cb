/* SPDX-License-Identifier: MIT */
/* Check that the numbers of an open basis can be those of lungs. Every limit is far outside of what
 * lungs have, and far inside of what floats can hold, so that no later computation overflows. */
#include <math.h>
#include <stdio.h>

#include <supine/sh.h>

#include "base/number.h"
#include "runtime/internal.h"

static const double farthest_mm = 1e7;     /* limit for distances from the origin, mm */
static const double largest_move_mm = 1e6; /* limit for displacements, mm */
static const double largest_ml = 1e9;      /* limit for the volume of a lung, mL: 10 m each way */
static const double largest_form_ml = 1e9; /* limit for coefficients of volumes, mL */
static const double largest_weight = 1e5;  /* limit for the weight of a mode */
static const double largest_bend = 2;   /* limit for constants of the path (supine_volume_bend) */
static const double largest_normal = 1; /* limit for coefficients of normals */
/* Smallest difference between the volumes at rest and of the reference surface, as a share of the
 * latter, in the posture where it is largest. */
static const double least_rest_share = 1e-6;

/* Return the largest magnitude of `count` numbers; 0 if there are none. */
static double largest_of(const double *values, size_t count) {
  double largest = 0;
  if (values != NULL) {
    for (size_t i = 0; i < count; ++i) {
      largest = fmax(largest, fabs(values[i]));
    }
  }
  return largest;
}

static bool plausible_positions(const supine_basis *basis, char *detail, size_t size) {
  double farthest = fmax(basis->reference_size, fabs(basis->midline));
  bool ordered = true;
  for (size_t axis = 0; axis < 3; ++axis) {
    const double low = basis->box[0][axis];
    const double high = basis->box[1][axis];
    farthest = fmax(farthest, fmax(fabs(low), fabs(high)));
    ordered = ordered && low <= high;
  }
  if (!ordered || farthest > farthest_mm) {
    (void)supine_print_text(
        detail, size,
        "a position, the box of the lungs or the midline is %g mm from the origin, more "
        "than %g mm, or the box is empty",
        farthest, farthest_mm);
    return false;
  }
  return true;
}

/* Check the largest weight of each mode, and the sum of the largest displacements by each mode, in
 * any posture. By Cauchy's inequality, and because the squares of all harmonics up to band L add up
 * to (L + 1)^2 / (4 pi), a weight is at most
 *
 *     |w_k| <= |modes_k| (L + 1) / sqrt(4 pi) sqrt(N)
 *
 * with N polynomials of the volume, each at most 1. */
static bool plausible_modes(const supine_basis *basis, char *detail, size_t size) {
  const size_t orders = basis->info.order + 1;
  const size_t count = supine_sh_count(basis->info.band) * orders;
  double weight = 0;
  double moved = 0;
  for (size_t k = 0; k < basis->info.mode_count; ++k) {
    double square = 0;
    for (size_t i = 0; i < count; ++i) {
      const double x = basis->info.modes[k * count + i];
      square += x * x;
    }
    const double most =
        sqrt(square * (double)orders) * (double)(basis->info.band + 1) * 0.28209479177387814;
    weight = fmax(weight, most);
    moved += most * basis->mode_size[k];
  }
  if (!(weight <= largest_weight) || !(moved <= largest_move_mm)) {
    (void)supine_print_text(
        detail, size,
        "modes have weights of up to %g and displacements of up to %g mm, more than %g and %g mm",
        weight, moved, largest_weight, largest_move_mm);
    return false;
  }
  return true;
}

static bool plausible_forms(const supine_basis *basis, char *detail, size_t size) {
  const supine_basis_info *info = &basis->info;
  const size_t k = info->mode_count;
  const size_t rows = info->lung_count * 3;
  const double form = fmax(fmax(largest_of(info->volume_linear, rows * k),
                                largest_of(info->volume_quadratic, rows * k * k)),
                           largest_of(info->volume_cubic, info->lung_count * k * k * k));
  const size_t normals =
      info->lung_count * info->normal_count * 3 * supine_basis_normal_terms(basis);
  if (form > largest_form_ml) {
    (void)supine_print_text(detail, size, "a coefficient of the volumes is %g mL, above %g mL",
                            form, largest_form_ml);
    return false;
  }
  if (largest_of(info->normal_weights, normals) > largest_normal) {
    (void)supine_print_text(detail, size, "tensor 'normal_weights' has a number above %g",
                            largest_normal);
    return false;
  }
  return true;
}

/* Check the volumes of the reference surface, and the constants of the scan. */
static bool plausible_scan(const supine_basis *basis, char *detail, size_t size) {
  const double *g = basis->scan_gravity;
  const double length = sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2]);
  for (size_t lung = 0; lung < basis->info.lung_count; ++lung) {
    if (!(fabs(basis->reference_volume[lung]) <= largest_ml)) {
      (void)supine_print_text(
          detail, size, "the reference volume of lung '%s' is %g mL, above %g mL",
          basis->info.lung_names[lung], basis->reference_volume[lung], largest_ml);
      return false;
    }
  }
  if (!(fabs(basis->scan_volume) <= largest_ml)) {
    (void)supine_print_text(detail, size, "metadata 'scan_volume_ml' is %g, above %g",
                            basis->scan_volume, largest_ml);
    return false;
  }
  if (!(fabs(length - 1) <= 1e-3)) {
    (void)supine_print_text(detail, size, "metadata 'scan_gravity' has the length %g, not 1",
                            length);
    return false;
  }
  if (!(basis->upright_gain >= 0 && basis->upright_gain <= 1)) {
    (void)supine_print_text(detail, size, "metadata 'full_upright_gain' is %g, not 0 to 1",
                            basis->upright_gain);
    return false;
  }
  if (largest_of(basis->info.bend, 3) > largest_bend) {
    (void)supine_print_text(detail, size, "metadata 'bend' has a number above %g", largest_bend);
    return false;
  }
  return true;
}

/* Check the volumes at rest of a row of the tensor, which belong to lungs of `reference` mL, in 26
 * directions of gravity: towards the faces, edges and corners of a cube. */
static bool plausible_row(const double *row, double reference, char *detail, size_t size) {
  double farthest = 0;
  for (int number = 0; number < 27; ++number) {
    const double gravity[3] = {number % 3 - 1, number / 3 % 3 - 1, number / 9 - 1};
    double y[RESTING_TERMS];
    if (supine_sh_evaluate(2, gravity, y) != SUPINE_OK) {
      continue; /* the zero vector has no direction */
    }
    const double change = supine_basis_sum_harmonics(row, y);
    if (!(change > -reference && change < reference)) {
      (void)supine_print_text(
          detail, size,
          "tensor 'resting_volume' has %g mL at rest in a posture, for lungs with a "
          "reference volume of %g mL",
          reference + change, reference);
      return false;
    }
    farthest = fmax(farthest, fabs(change));
  }
  if (farthest < least_rest_share * reference) {
    (void)supine_print_text(
        detail, size, "tensor 'resting_volume' differs from the reference volume by only %g mL",
        farthest);
    return false;
  }
  return true;
}

/* Check the volumes at rest, but not those that another simulator computed: its reference surface
 * may be at rest or far below. */
static bool plausible_rest(const supine_basis *basis, char *detail, size_t size) {
  if (basis->resting == NULL || basis->info.order > 0) {
    return true;
  }
  for (size_t lung = 0; lung < basis->info.lung_count; ++lung) {
    if (!plausible_row(basis->resting + lung * RESTING_TERMS, basis->reference_volume[lung], detail,
                       size)) {
      return false;
    }
  }
  return true;
}

/* Check the volumes that another simulator computed. */
static bool plausible_simulated(const supine_basis *basis, char *detail, size_t size) {
  const supine_simulated *s = &basis->simulated;
  const size_t lungs = basis->info.lung_count;
  const struct {
    const double *numbers;
    size_t count;
  } volumes[] = {{s->range, 2 * lungs},
                 {s->limits, 2 * lungs * s->limit_terms},
                 {s->shares, lungs * RESTING_TERMS * s->share_count},
                 {s->full, lungs * RESTING_TERMS},
                 {s->total, 2},
                 {basis->resting, lungs * RESTING_TERMS}};
  double most = 0;
  for (size_t i = 0; i < sizeof volumes / sizeof *volumes; ++i) {
    most = fmax(most, largest_of(volumes[i].numbers, volumes[i].count));
  }
  if (!(most <= largest_ml)) {
    (void)supine_print_text(detail, size, "a simulated volume is %g mL, above %g mL", most,
                            largest_ml);
    return false;
  }
  return true;
}

bool supine_basis_is_plausible(const supine_basis *basis, char *detail, size_t size) {
  return plausible_positions(basis, detail, size) && plausible_modes(basis, detail, size) &&
         plausible_forms(basis, detail, size) && plausible_scan(basis, detail, size) &&
         plausible_rest(basis, detail, size) && plausible_simulated(basis, detail, size);
}
