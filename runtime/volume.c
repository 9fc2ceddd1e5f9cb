/* SPDX-License-Identifier: MIT */
/* Volume against breath scale, a cubic, and its inverse. */
#include <math.h>
#include <stdbool.h>

#include <supine/volume.h>

void supine_volume_add(size_t count, const double *linear, const double *quadratic,
                       const double *third, const double *weights, double cubic[3]) {
  const double *w = weights;
  for (size_t i = 0; i < count; ++i) {
    double square = 0;
    double cube = 0;
    for (size_t j = 0; j < count; ++j) {
      double row = 0;
      for (size_t m = 0; m < count; ++m) {
        row += third[(i * count + j) * count + m] * w[m];
      }
      square += quadratic[i * count + j] * w[j];
      cube += row * w[j];
    }
    cubic[0] += linear[i] * w[i];
    cubic[1] += square * w[i];
    cubic[2] += cube * w[i];
  }
}

double supine_volume_at(const double cubic[3], double scale) {
  return scale * (cubic[0] + scale * (cubic[1] + scale * cubic[2]));
}

static double cubic_slope(const double c[3], double s) {
  return c[0] + s * (2 * c[1] + s * 3 * c[2]);
}

/* The nearest s on one side of 0 where the slope is 0; infinite where there is none. */
static double cubic_turn(const double c[3], double side) {
  double roots[2] = {INFINITY, INFINITY};
  const double discriminant = c[1] * c[1] - 3 * c[0] * c[2];
  if (discriminant >= 0) {
    /* 3 c s^2 + 2 b s + a = 0 without cancellation; a root may be infinite or NaN. */
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

/* Newton's steps, or bisection where they leave [low, high], between which the volume's difference
 * changes sign and the cubic is monotone. */
static double cubic_solve(const double c[3], double volume, double low, double high) {
  const bool rising = supine_volume_at(c, high) > supine_volume_at(c, low);
  double s = volume / c[0];
  for (int i = 0; i < 200; ++i) {
    if (!(s > low && s < high)) {
      s = low + (high - low) / 2;
    }
    const double residual = supine_volume_at(c, s) - volume;
    if (residual == 0 || s == low || s == high) {
      return s;
    }
    if ((residual > 0) == rising) {
      high = s;
    } else {
      low = s;
    }
    const double next = s - residual / cubic_slope(c, s);
    if (fabs(next - s) <= 1e-16 * fabs(s)) {
      return s;
    }
    s = next;
  }
  return s;
}

supine_status supine_volume_scale(const double cubic[3], double volume, double *scale,
                                  supine_error *error) {
  const double *c = cubic;
  if (volume == 0) {
    *scale = 0;
    return SUPINE_OK;
  }
  if (!isfinite(volume) || !isfinite(c[0] + c[1] + c[2]) || c[0] == 0) {
    return supine_error_set(error, SUPINE_ERROR_NUMERICAL,
                            "a volume of %g mL cannot be reached: here no scale changes it",
                            volume);
  }
  const double side = volume / c[0] > 0 ? 1 : -1;
  double far = cubic_turn(c, side);
  if (isfinite(far)) {
    const double reach = supine_volume_at(c, far);
    if (fabs(reach) < fabs(volume)) {
      return supine_error_set(error, SUPINE_ERROR_NUMERICAL,
                              "a volume of %g mL is out of reach: the surface folds beyond %g mL",
                              volume, reach);
    }
  } else {
    far = volume / c[0];
    while (isfinite(far) && fabs(supine_volume_at(c, far)) < fabs(volume)) {
      far *= 2;
    }
    far *= 2;
    if (!isfinite(far)) {
      return supine_error_set(error, SUPINE_ERROR_NUMERICAL,
                              "a volume of %g mL cannot be reached: here no scale changes it",
                              volume);
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

supine_status supine_volume_form_scale(const supine_volume_form *form, double volume, double *scale,
                                       supine_error *error) {
  const double *f = form->of;
  const double cubic[3] = {f[0] + f[1] + f[2], f[3] + f[4] + f[5], f[6]};
  return supine_volume_scale(cubic, volume, scale, error);
}
