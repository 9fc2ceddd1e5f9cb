/* SPDX-License-Identifier: MIT */
/* Pose a basis of another simulator's fields over gravity and volume. */
#include <math.h>
#include <string.h>

#include <supine/inputs.h>
#include <supine/sh.h>

#include "base/arena.h"
#include "runtime/simulated.h"

/* Difference between the volume asked and the volume of the surface that ends the search, mL. A
 * volume may be outside the limits by as much, as sums of volumes are rounded. */
static const double close_enough = 1e-6;

/* Part of the simulated range that the limits of a basis add to it at both ends
 * (precompute/fields/limits.c). */
static const double margin = 0.01;

/* How far outside the simulated range of t the search may go: the volume of the surface differs
 * from the one that t stands for by less than that. */
static const double beyond = 0.1;

/* Number of intervals of t in which roots are sought where the ends of the range have none between
 * them. */
enum { SEARCH_STEPS = 64 };

supine_status supine_simulated_limits(const supine_basis *basis, const double gravity[3],
                                      double (*limits)[2]) {
  double y[(LIMIT_BAND_MAX + 1) * (LIMIT_BAND_MAX + 1)];
  const size_t terms = basis->simulated.limit_terms;
  size_t band = 0;
  while (supine_sh_count(band) < terms) {
    ++band;
  }
  SUPINE_TRY(supine_sh_evaluate(band, gravity, y));
  for (size_t row = 0; row < 2 * basis->info.lung_count; ++row) {
    double *limit = &limits[row / 2][row % 2];
    *limit = 0;
    for (size_t t = 0; t < terms; ++t) {
      *limit += basis->simulated.limits[row * terms + t] * y[t];
    }
  }
  return SUPINE_OK;
}

static double map_to_unit(double value, const double range[2]) {
  return 2 * (value - range[0]) / (range[1] - range[0]) - 1;
}

/* Refuse a volume outside the limits [low, high] of one lung, or of all lungs if `lung` is NULL.
 * Limits are `margin` times the simulated range wider than this range, at both ends. */
static supine_status refuse_volume(const char *lung, double volume, double low, double high,
                                   supine_error *error) {
  const double wider = margin / (1 + 2 * margin) * (high - low);
  return supine_error_set(error, SUPINE_ERROR_NUMERICAL,
                          "%s%s %s simulated at %.0f to %.0f mL in this posture, not at %.0f mL: "
                          "choose a volume in this range",
                          lung == NULL ? "the lungs" : "lung ", lung == NULL ? "" : lung,
                          lung == NULL ? "were" : "was", low + wider, high - wider, volume);
}

/* Return whether a volume is outside the simulated range. */
static bool is_outside(double volume, double low, double high) {
  const double distance = fmax(low - volume, volume - high);
  return supine_input_judge(SUPINE_INPUT_FIELDS_VOLUME, distance - close_enough) !=
         SUPINE_INPUT_TAKEN;
}

/* Move the volume of each lung into its limits, and give what is left to lungs that have room. */
static void keep_within(size_t count, const double (*limits)[2], double total, double *volumes) {
  double left = total;
  for (size_t lung = 0; lung < count; ++lung) {
    volumes[lung] = fmin(fmax(volumes[lung], limits[lung][0]), limits[lung][1]);
    left -= volumes[lung];
  }
  for (size_t lung = 0; lung < count; ++lung) {
    const double room =
        left > 0 ? limits[lung][1] - volumes[lung] : limits[lung][0] - volumes[lung];
    const double moved = fabs(left) < fabs(room) ? left : room;
    volumes[lung] += moved;
    left -= moved;
  }
}

/* Compute what the fit of the simulated volumes gives each lung of a total.
 * @param total    mL above the reference surfaces
 * @param volumes  [lungs] mL above the reference surface of each lung, written; they add up to the
 *   total if that was simulated */
static supine_status fitted_shares(const supine_basis *basis, const double gravity[3], double total,
                                   double *volumes) {
  const supine_simulated *s = &basis->simulated;
  double products[RESTING_TERMS * (SUPINE_SH_ORDER_MAX + 1)];
  const size_t terms = RESTING_TERMS * s->share_count;
  const double t = fmin(fmax(map_to_unit(total, s->total), -1), 1);
  SUPINE_TRY(supine_sh_evaluate_products(2, s->share_count - 1, gravity, t, products));
  for (size_t lung = 0; lung < basis->info.lung_count; ++lung) {
    volumes[lung] = 0;
    for (size_t i = 0; i < terms; ++i) {
      volumes[lung] += s->shares[lung * terms + i] * products[i];
    }
  }
  return SUPINE_OK;
}

supine_status supine_simulated_find_offsets(const supine_basis *basis, double *offsets) {
  SUPINE_TRY(fitted_shares(basis, basis->scan_gravity, 0, offsets));
  for (size_t lung = 0; lung < basis->info.lung_count; ++lung) {
    offsets[lung] = -offsets[lung];
  }
  return SUPINE_OK;
}

/* Divide a total volume among the lungs: as the simulator did, plus a constant for each lung. The
 * constants make each lung hold its volume in the scan if all lungs together do, in that posture.
 * @param total    mL above the reference surfaces
 * @param volumes  [lungs] mL above the reference surface of each lung, written; they add up to the
 *   total */
static supine_status share_out(const supine_basis *basis, const double gravity[3], double total,
                               double *volumes, supine_error *error) {
  const size_t lungs = basis->info.lung_count;
  double limits[SUPINE_LUNGS_MAX][2];
  double range[3] = {0, 0, 0}; /* lowest and highest total, and the reference volume of all lungs */
  SUPINE_TRY(supine_simulated_limits(basis, gravity, limits));
  SUPINE_TRY(fitted_shares(basis, gravity, total, volumes));
  for (size_t lung = 0; lung < lungs; ++lung) {
    range[0] += limits[lung][0];
    range[1] += limits[lung][1];
    range[2] += basis->info.reference_volume[lung];
    volumes[lung] += basis->simulated.offset[lung];
  }
  if (is_outside(total, range[0], range[1])) {
    return refuse_volume(NULL, range[2] + total, range[2] + range[0], range[2] + range[1], error);
  }
  keep_within(lungs, (const double(*)[2])limits, total, volumes);
  return SUPINE_OK;
}

/* The modes for one direction of gravity: weights as polynomials of t. */
typedef struct path {
  const supine_basis *basis;
  size_t lung;
  double coefficient[SUPINE_MODES_MAX][SUPINE_SH_ORDER_MAX + 1];
} path;

static supine_status find_path(const supine_basis *basis, const double gravity[3], path *p) {
  double y[(SUPINE_SH_BAND_MAX + 1) * (SUPINE_SH_BAND_MAX + 1)];
  const size_t harmonics = supine_sh_count(basis->info.band);
  const size_t orders = basis->info.order + 1;
  SUPINE_TRY(supine_sh_evaluate(basis->info.band, gravity, y));
  p->basis = basis;
  for (size_t k = 0; k < basis->info.mode_count; ++k) {
    memset(p->coefficient[k], 0, sizeof p->coefficient[k]);
    for (size_t i = 0; i < harmonics * orders; ++i) {
      p->coefficient[k][i % orders] +=
          basis->info.modes[k * harmonics * orders + i] * y[i / orders];
    }
  }
  return SUPINE_OK;
}

/* Compute the weights at t, [modes]. Return the volume of the lung above its reference, mL. */
static double follow(const path *p, double t, double *weights) {
  static const double ones[3] = {1, 1, 1};
  const supine_basis *basis = p->basis;
  double polynomial[SUPINE_SH_ORDER_MAX + 1] = {1, t};
  supine_volume_form form;
  for (size_t n = 2; n <= basis->info.order; ++n) {
    polynomial[n] = 2 * t * polynomial[n - 1] - polynomial[n - 2];
  }
  for (size_t k = 0; k < basis->info.mode_count; ++k) {
    weights[k] = 0;
    for (size_t n = 0; n <= basis->info.order; ++n) {
      weights[k] += p->coefficient[k][n] * polynomial[n];
    }
  }
  supine_basis_contract(basis, p->lung, weights, &form);
  return supine_volume_form_at(&form, ones);
}

/* An interval of t, and how far the volume of the surface lies above the volume asked at its ends,
 * mL. */
typedef struct bracket {
  double low, high;
  double below, above;
} bracket;

static bool has_root(const bracket *b) {
  return b->below <= close_enough && b->above >= -close_enough;
}

/* Find the weights of a lung at which it holds `volume`, by the rule of false position with the
 * Illinois correction and, if that is slow, by bisection, in a bracket that has a root. */
static bool close_in(const path *p, double volume, bracket b, double *weights) {
  int side = 0;
  for (int step = 0; step < 200; ++step) {
    const double middle = 0.5 * (b.low + b.high);
    const double t = step < 100 && b.above > b.below
                         ? (b.low * b.above - b.high * b.below) / (b.above - b.below)
                         : middle;
    const double residual = follow(p, t, weights) - volume;
    if (fabs(residual) <= close_enough || b.high - b.low < 1e-14) {
      return true;
    }
    if (residual > 0) {
      b.high = t;
      b.above = residual;
      b.below *= side > 0 ? 0.5 : 1;
      side = 1;
    } else {
      b.low = t;
      b.below = residual;
      b.above *= side < 0 ? 0.5 : 1;
      side = -1;
    }
  }
  return false;
}

/* Find the weights of a lung at which it holds `volume` between t = low and t = high. A surface
 * whose volume does not rise all the way has brackets inside: take the one nearest to t = `near`.
 * Return whether there is a root. */
static bool solve(const path *p, double volume, double low, double high, double near,
                  double *weights) {
  bracket whole = {low, high, follow(p, low, weights) - volume, follow(p, high, weights) - volume};
  bracket best = whole;
  bool found = has_root(&whole);
  if (!found) {
    bracket b = {low, low, whole.below, whole.below};
    double nearest = INFINITY;
    for (int step = 1; step <= SEARCH_STEPS; ++step) {
      b.low = b.high;
      b.below = b.above;
      b.high = low + (high - low) * step / SEARCH_STEPS;
      b.above = follow(p, b.high, weights) - volume;
      const double distance = fabs(0.5 * (b.low + b.high) - near);
      if (has_root(&b) && distance < nearest) {
        nearest = distance;
        best = b;
        found = true;
      }
    }
  }
  return found && close_in(p, volume, best, weights);
}

/* Compute the weights of all lungs at which each holds its volume.
 * @param volumes  [lungs] mL above the reference surface */
static supine_status solve_lungs(const supine_basis *basis, const double gravity[3],
                                 const double *volumes, supine_pose *pose, supine_error *error) {
  double limits[SUPINE_LUNGS_MAX][2];
  path p;
  SUPINE_TRY(find_path(basis, gravity, &p));
  SUPINE_TRY(supine_simulated_limits(basis, gravity, limits));
  for (size_t lung = 0; lung < basis->info.lung_count; ++lung) {
    const double *range = basis->simulated.range + 2 * lung;
    const double reference = basis->info.reference_volume[lung];
    double *weights = pose->weights + lung * basis->info.mode_count;
    p.lung = lung;
    if (is_outside(volumes[lung], limits[lung][0], limits[lung][1])) {
      return refuse_volume(basis->info.lung_names[lung], reference + volumes[lung],
                           reference + limits[lung][0], reference + limits[lung][1], error);
    }
    if (!solve(&p, volumes[lung], map_to_unit(limits[lung][0], range) - beyond,
               map_to_unit(limits[lung][1], range) + beyond, map_to_unit(volumes[lung], range),
               weights)) {
      return supine_error_set(
          error, SUPINE_ERROR_NUMERICAL,
          "lung %s was simulated at %.0f to %.0f mL in this posture, but the fit "
          "to the simulations has no surface that holds %.0f mL: simulate more "
          "volumes, or choose another one",
          basis->info.lung_names[lung], reference + limits[lung][0], reference + limits[lung][1],
          reference + volumes[lung]);
    }
    for (size_t axis = 0; axis < 3; ++axis) {
      pose->gains[lung][axis] = 1;
    }
  }
  return SUPINE_OK;
}

static supine_status refuse_kind(const char *what, supine_error *error) {
  return supine_error_set(
      error, SUPINE_ERROR_ARGUMENT,
      "the simulations do not say which volume is %s: name it when the basis is "
      "made, or use an absolute volume such as 2600mL",
      what);
}

/* Compute the volume of each lung, mL above its reference surface, to which volumes of a kind are
 * relative: at rest, at full inflation, in the scan (the reference surface), or 0 mL. */
static supine_status find_origin(const supine_basis *basis, const double gravity[3],
                                 supine_volume_kind kind, double *volumes, supine_error *error) {
  double y[RESTING_TERMS];
  SUPINE_TRY(supine_sh_evaluate(2, gravity, y));
  for (size_t lung = 0; lung < basis->info.lung_count; ++lung) {
    switch (kind) {
    case SUPINE_VOLUME_REST:
      if (!basis->info.has_rest) {
        return refuse_kind("rest", error);
      }
      volumes[lung] = supine_basis_sum_harmonics(basis->resting + lung * RESTING_TERMS, y);
      break;
    case SUPINE_VOLUME_FULL:
      if (!basis->info.has_full) {
        return refuse_kind("full inflation", error);
      }
      volumes[lung] = supine_basis_sum_harmonics(basis->simulated.full + lung * RESTING_TERMS, y);
      break;
    case SUPINE_VOLUME_ABSOLUTE:
      volumes[lung] = -basis->info.reference_volume[lung];
      break;
    case SUPINE_VOLUME_SCAN:
      volumes[lung] = 0;
      break;
    default:
      return supine_basis_refuse_kind(kind, error);
    }
  }
  return SUPINE_OK;
}

supine_status supine_simulated_range(const supine_basis *basis, const double gravity[3],
                                     supine_volume_kind kind, double range[2],
                                     supine_error *error) {
  double limits[SUPINE_LUNGS_MAX][2];
  double origin[SUPINE_LUNGS_MAX];
  range[0] = 0;
  range[1] = 0;
  SUPINE_TRY(supine_simulated_limits(basis, gravity, limits));
  SUPINE_TRY(find_origin(basis, gravity, kind, origin, error));
  for (size_t lung = 0; lung < basis->info.lung_count; ++lung) {
    range[0] += limits[lung][0] - origin[lung];
    range[1] += limits[lung][1] - origin[lung];
  }
  return SUPINE_OK;
}

/* Find the volumes of a state that names its lungs. */
static supine_status named_volumes(const supine_basis *basis, const supine_state *state,
                                   double *volumes, supine_error *error) {
  size_t lungs[SUPINE_LUNGS_MAX];
  SUPINE_TRY(supine_basis_find_lungs(basis, state, lungs, error));
  for (size_t i = 0; i < state->lung_count; ++i) {
    double origin[SUPINE_LUNGS_MAX];
    SUPINE_TRY(find_origin(basis, state->gravity, state->lungs[i].volume.kind, origin, error));
    volumes[lungs[i]] = origin[lungs[i]] + state->lungs[i].volume.ml;
  }
  return SUPINE_OK;
}

supine_status supine_simulated_find_default(const supine_basis *basis, supine_volume *volume) {
  double common[2] = {-INFINITY, INFINITY}; /* totals above the reference, in every direction */
  double reference = 0;
  bool scan = true; /* whether every lung can hold the volume of the scan in every direction */
  for (int node = 0; node < 27; ++node) {
    const double gravity[3] = {node % 3 - 1, node / 3 % 3 - 1, node / 9 - 1};
    double limits[SUPINE_LUNGS_MAX][2];
    double total[2] = {0, 0};
    if (node == 27 / 2) {
      continue; /* no direction */
    }
    SUPINE_TRY(supine_simulated_limits(basis, gravity, limits));
    for (size_t lung = 0; lung < basis->info.lung_count; ++lung) {
      scan = scan && limits[lung][0] <= 0 && limits[lung][1] >= 0;
      total[0] += limits[lung][0];
      total[1] += limits[lung][1];
    }
    common[0] = fmax(common[0], total[0]);
    common[1] = fmin(common[1], total[1]);
  }
  for (size_t lung = 0; lung < basis->info.lung_count; ++lung) {
    reference += basis->info.reference_volume[lung];
  }
  *volume = (supine_volume){SUPINE_VOLUME_SCAN, 0};
  if (basis->info.has_rest) {
    volume->kind = SUPINE_VOLUME_REST;
  } else if (!scan) {
    *volume =
        (supine_volume){SUPINE_VOLUME_ABSOLUTE, round(reference + 0.5 * (common[0] + common[1]))};
  }
  return SUPINE_OK;
}

/* Find the volumes of a state. Those of a state of all lungs depend on their total alone, whatever
 * it is relative to: otherwise the lungs would jump between scan and scan+0.01, or at rest. */
static supine_status find_volumes(const supine_basis *basis, const supine_state *state,
                                  double *volumes, supine_error *error) {
  supine_volume asked = state->volume;
  if (state->lung_count > 0) {
    return named_volumes(basis, state, volumes, error);
  }
  if (asked.kind == SUPINE_VOLUME_DEFAULT) {
    asked = basis->simulated.usual;
  }
  SUPINE_TRY(find_origin(basis, state->gravity, asked.kind, volumes, error));
  double total = asked.ml;
  for (size_t lung = 0; lung < basis->info.lung_count; ++lung) {
    total += volumes[lung];
  }
  return share_out(basis, state->gravity, total, volumes, error);
}

supine_status supine_simulated_pose(const supine_basis *basis, const supine_state *state,
                                    supine_pose *pose, supine_error *error) {
  double volumes[SUPINE_LUNGS_MAX];
  SUPINE_TRY(find_volumes(basis, state, volumes, error));
  return solve_lungs(basis, state->gravity, volumes, pose, error);
}
