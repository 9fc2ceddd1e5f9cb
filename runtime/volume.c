/* SPDX-License-Identifier: MIT */
/* Compute the volume of a lung from its gains (factors of its displacement along x, y and z), and
 * the gains from the volume. */
#include <math.h>
#include <stdbool.h>

#include "base/arena.h"
#include "base/vec3.h"
#include "runtime/internal.h"

double supine_volume_square(size_t count, const double *form, const double *w) {
  double sum = 0;
  for (size_t i = 0; i < count; ++i) {
    sum += w[i] * supine_dot_n(count, form + i * count, w);
  }
  return sum;
}

void supine_volume_contract(size_t count, const double *linear, const double *quadratic,
                            const double *third, const double *weights, supine_volume_form *form) {
  for (size_t axis = 0; axis < 3; ++axis) {
    form->of[axis] += supine_dot_n(count, linear + axis * count, weights);
    form->of[3 + axis] += supine_volume_square(count, quadratic + axis * count * count, weights);
  }
  for (size_t i = 0; i < count; ++i) {
    form->of[6] += weights[i] * supine_volume_square(count, third + i * count * count, weights);
  }
}

/* Return c[0] s + c[1] s^2 + c[2] s^3 for the coefficients c = `cubic` at s = `scale`. */
static double cubic_at(const double cubic[3], double scale) {
  return scale * (cubic[0] + scale * (cubic[1] + scale * cubic[2]));
}

/* Find the s nearest to 0, with the sign of `side` (1 or -1), at which the slope of cubic_at() is
 * 0. Return an infinite s if there is none. */
static double cubic_turn(const double c[3], double side) {
  double roots[2] = {INFINITY, INFINITY};
  const double discriminant = c[1] * c[1] - 3 * c[0] * c[2];
  if (discriminant >= 0) {
    /* Solve 3 c[2] s^2 + 2 c[1] s + c[0] = 0 without cancellation; a root may be inf or NaN. */
    const double q = -(c[1] + copysign(sqrt(discriminant), c[1]));
    roots[0] = q / (3 * c[2]);
    roots[1] = c[0] / q;
  }
  double nearest = INFINITY;
  for (int i = 0; i < 2; ++i) {
    const double distance = roots[i] * side;
    if (distance > 0 && distance < nearest) {
      nearest = distance;
    }
  }
  return nearest * side;
}

/* Find the s between `low` and `high` at which cubic_at() is `volume`, by Newton's method. Bisect
 * if a step leaves the bracket. cubic_at() must be monotone in this range. */
static double cubic_solve(const double c[3], double volume, double low, double high) {
  const bool rising = cubic_at(c, high) > cubic_at(c, low);
  double s = volume / c[0];
  for (int i = 0; i < 200; ++i) {
    if (!(s > low && s < high)) {
      s = low + (high - low) / 2;
    }
    const double residual = cubic_at(c, s) - volume;
    if (residual == 0 || s == low || s == high) {
      return s;
    }
    if ((residual > 0) == rising) {
      high = s;
    } else {
      low = s;
    }
    const double slope = c[0] + s * (2 * c[1] + s * 3 * c[2]);
    const double next = s - residual / slope;
    if (fabs(next - s) <= 1e-16 * fabs(s)) {
      return s;
    }
    s = next;
  }
  return s;
}

static supine_status refuse_constant(double volume, supine_error *error) {
  return supine_error_set(
      error, SUPINE_ERROR_NUMERICAL,
      "the lungs cannot hold %.0f mL %s than in the reference surface: nothing in "
      "the basis changes their volume in this posture; choose another posture",
      fabs(volume), volume < 0 ? "less" : "more");
}

static supine_status refuse_folded(double volume, double limit, supine_error *error) {
  return supine_error_set(
      error, SUPINE_ERROR_NUMERICAL,
      "%.0f mL %s than in the reference surface is out of reach: the surface folds "
      "at %.0f mL %s; choose a volume nearer to it",
      fabs(volume), volume < 0 ? "less" : "more", fabs(limit), volume < 0 ? "less" : "more");
}

supine_status supine_volume_scale(const double cubic[3], double volume, double *scale,
                                  supine_error *error) {
  const double *c = cubic;
  if (!isfinite(volume) || !isfinite(c[0] + c[1] + c[2])) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "the volume or a coefficient of the volume is not finite");
  }
  if (volume == 0) {
    *scale = 0;
    return SUPINE_OK;
  }
  if (c[0] == 0) {
    return refuse_constant(volume, error);
  }
  const double side = volume / c[0] > 0 ? 1 : -1;
  double far = cubic_turn(c, side);
  if (isfinite(far)) {
    const double reach = cubic_at(c, far);
    if (fabs(reach) < fabs(volume)) {
      return refuse_folded(volume, reach, error);
    }
  } else {
    far = volume / c[0];
    while (isfinite(far) && fabs(cubic_at(c, far)) < fabs(volume)) {
      far *= 2;
    }
    far *= 2;
    if (!isfinite(far)) {
      return refuse_constant(volume, error);
    }
  }
  *scale = side > 0 ? cubic_solve(c, volume, 0, far) : cubic_solve(c, volume, far, 0);
  return SUPINE_OK;
}

double supine_volume_form_at(const supine_volume_form *form, const double gains[3]) {
  const double *f = form->of;
  const double x = gains[0];
  const double y = gains[1];
  const double z = gains[2];
  return x * f[0] + y * f[1] + z * f[2] + y * z * f[3] + x * z * f[4] + x * y * f[5] +
         x * y * z * f[6];
}

void supine_volume_form_along(const supine_volume_form *form, const double ratio[3],
                              double cubic[3]) {
  const double *f = form->of;
  const double *a = ratio;
  cubic[0] = a[0] * f[0] + a[1] * f[1] + a[2] * f[2];
  cubic[1] = a[1] * a[2] * f[3] + a[0] * a[2] * f[4] + a[0] * a[1] * f[5];
  cubic[2] = a[0] * a[1] * a[2] * f[6];
}

void supine_volume_bend(const double bend[3], double sigma, double ratio[3]) {
  const double cube = sigma * sigma * sigma;
  const double e = sigma <= 1 ? (cube - sigma) / 2 : (sigma - 1) / (cube * cube);
  for (size_t axis = 0; axis < 3; ++axis) {
    ratio[axis] = sigma + 2 * bend[axis] * e;
  }
}

static bool is_finite_form(const supine_volume_form *form) {
  double sum = 0;
  for (size_t i = 0; i < 7; ++i) {
    sum += fabs(form->of[i]);
  }
  return isfinite(sum);
}

/* Refuse gains above SUPINE_POSE_LIMIT: displacements that hardly change the volume. */
static supine_status check_gains(double volume, const double gains[3], supine_error *error) {
  const double largest = fmax(fabs(gains[0]), fmax(fabs(gains[1]), fabs(gains[2])));
  return largest < SUPINE_POSE_LIMIT ? SUPINE_OK : refuse_constant(volume, error);
}

static double volume_on_path(const supine_volume_form *form, const double bend[3], double scale,
                             double sigma, double gains[3]) {
  supine_volume_bend(bend, sigma, gains);
  for (size_t axis = 0; axis < 3; ++axis) {
    gains[axis] *= scale;
  }
  return supine_volume_form_at(form, gains);
}

/* Limit of the position on the path: this many times the way from full inflation to rest, in steps
 * of 1 / STEPS_EACH. */
enum { PATH_MOST = 64, STEPS_EACH = 16 };

/* Find the gains of a lung (factors of its displacement) at which it holds `volume`, mL more than
 * its reference surface. Step along the path from full inflation through rest (supine_volume_bend)
 * until the volume is passed, then bisect the last step. */
static supine_status follow_path(const supine_volume_form *form, const double bend[3], double scale,
                                 double rest, double volume, double gains[3], supine_error *error) {
  const double step = volume / rest > 0 ? 1.0 / STEPS_EACH : -1.0 / STEPS_EACH;
  const double side = volume > 0 ? 1 : -1;
  double near = 0;
  double far = 0;
  double held = 0;
  for (int steps = 0; side * held < side * volume; ++steps) {
    const double before = held;
    if (steps == PATH_MOST * STEPS_EACH) {
      return supine_error_set(
          error, SUPINE_ERROR_NUMERICAL,
          "%.0f mL %s than in the reference surface is out of reach: %d times the displacement at "
          "rest gives %.0f mL; choose a volume nearer to it",
          fabs(volume), volume < 0 ? "less" : "more", (int)PATH_MOST, fabs(held));
    }
    near = far;
    far += step;
    held = volume_on_path(form, bend, scale, far, gains);
    if (!(side * held > side * before)) {
      return refuse_folded(volume, before, error);
    }
  }
  for (int halving = 0; halving < 60; ++halving) {
    const double middle = 0.5 * (near + far);
    held = volume_on_path(form, bend, scale, middle, gains);
    if (side * held < side * volume) {
      near = middle;
    } else {
      far = middle;
    }
  }
  return SUPINE_OK;
}

supine_status supine_volume_form_gains(const supine_volume_form *form, const double bend[3],
                                       double rest, double volume, double gains[3],
                                       supine_error *error) {
  static const double even[3] = {1, 1, 1};
  const bool straight = (bend[0] == 0 && bend[1] == 0 && bend[2] == 0) || volume == rest;
  double cubic[3];
  double scale = 0;
  if (!isfinite(volume) || !isfinite(bend[0] + bend[1] + bend[2]) || !is_finite_form(form) ||
      (!straight && !isfinite(rest))) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "a volume, a curvature or a coefficient of the volume is not finite");
  }
  supine_volume_form_along(form, even, cubic);
  SUPINE_TRY(supine_volume_scale(cubic, straight ? volume : rest, &scale, error));
  if (straight) {
    for (size_t axis = 0; axis < 3; ++axis) {
      gains[axis] = scale;
    }
  } else {
    SUPINE_TRY(follow_path(form, bend, scale, rest, volume, gains, error));
  }
  return check_gains(volume, gains, error);
}
