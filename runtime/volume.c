/* SPDX-License-Identifier: MIT */
/* Exact volumes: V(s) - V(0) = a s + b s^2 + c s^3, a, b, c forms in the weights. */
#include <math.h>
#include <stdbool.h>

#include "internal.h"

/* mL, of the breath scale s. */
typedef struct cubic {
  double a, b, c;
} cubic;

static cubic lung_cubic(const supine_basis *basis, size_t lung, const double *w) {
  const size_t k = basis->info.mode_count;
  const double *linear = basis->linear + lung * k;
  const double *quadratic = basis->quadratic + lung * k * k;
  const double *third = basis->cubic + lung * k * k * k;
  cubic p = {0, 0, 0};
  for (size_t i = 0; i < k; ++i) {
    double b = 0;
    double c = 0;
    for (size_t j = 0; j < k; ++j) {
      double row = 0;
      for (size_t m = 0; m < k; ++m) {
        row += third[(i * k + j) * k + m] * w[m];
      }
      b += quadratic[i * k + j] * w[j];
      c += row * w[j];
    }
    p.a += linear[i] * w[i];
    p.b += b * w[i];
    p.c += c * w[i];
  }
  return p;
}

static double cubic_value(const cubic *p, double s) {
  return s * (p->a + s * (p->b + s * p->c));
}

static double cubic_slope(const cubic *p, double s) {
  return p->a + s * (2 * p->b + s * 3 * p->c);
}

/* The nearest s on one side of 0 where the slope is 0; infinite where there is none. */
static double cubic_turn(const cubic *p, double side) {
  double roots[2] = {INFINITY, INFINITY};
  const double discriminant = p->b * p->b - 3 * p->a * p->c;
  if (discriminant >= 0) {
    /* 3 c s^2 + 2 b s + a = 0 without cancellation; a root may be infinite or NaN. */
    const double q = -(p->b + copysign(sqrt(discriminant), p->b));
    roots[0] = q / (3 * p->c);
    roots[1] = p->a / q;
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

/* Newton's steps, or bisection where they leave [low, high], between which p - volume changes
 * sign and p is monotone. */
static double cubic_solve(const cubic *p, double volume, double low, double high) {
  const bool rising = cubic_value(p, high) > cubic_value(p, low);
  double s = volume / p->a;
  for (int i = 0; i < 200; ++i) {
    if (!(s > low && s < high)) {
      s = low + (high - low) / 2;
    }
    const double residual = cubic_value(p, s) - volume;
    if (residual == 0 || s == low || s == high) {
      return s;
    }
    if ((residual > 0) == rising) {
      high = s;
    } else {
      low = s;
    }
    const double next = s - residual / cubic_slope(p, s);
    if (fabs(next - s) <= 1e-16 * fabs(s)) {
      return s;
    }
    s = next;
  }
  return s;
}

/* The root of p = volume that is reached from s = 0 without the volume turning back. */
static supine_status cubic_root(const cubic *p, double volume, double *scale, supine_error *error) {
  if (volume == 0) {
    *scale = 0;
    return SUPINE_OK;
  }
  if (!isfinite(volume) || !isfinite(p->a + p->b + p->c) || p->a == 0) {
    return supine_error_set(error, SUPINE_ERROR_NUMERICAL,
                            "a volume of %g mL cannot be reached: here no scale changes it",
                            volume);
  }
  const double side = volume / p->a > 0 ? 1 : -1;
  double far = cubic_turn(p, side);
  if (isfinite(far)) {
    const double reach = cubic_value(p, far);
    if (fabs(reach) < fabs(volume)) {
      return supine_error_set(error, SUPINE_ERROR_NUMERICAL,
                              "a volume of %g mL is out of reach: the surface folds beyond %g mL",
                              volume, reach);
    }
  } else {
    far = volume / p->a;
    while (isfinite(far) && fabs(cubic_value(p, far)) < fabs(volume)) {
      far *= 2;
    }
    far *= 2;
    if (!isfinite(far)) {
      return supine_error_set(error, SUPINE_ERROR_NUMERICAL,
                              "a volume of %g mL cannot be reached: here no scale changes it",
                              volume);
    }
  }
  *scale = side > 0 ? cubic_solve(p, volume, 0, far) : cubic_solve(p, volume, far, 0);
  return SUPINE_OK;
}

static supine_status need_volume(const supine_basis *basis, supine_error *error) {
  return basis->info.has_volume
             ? SUPINE_OK
             : supine_error_set(error, SUPINE_ERROR_OPEN_SURFACE,
                                "the basis has no volumes, as its surface is open: give a breath "
                                "scale instead, or close the mesh");
}

double supine_basis_lung_volume(const supine_basis *basis, size_t lung, const double *weights,
                                double scale) {
  const cubic p = lung_cubic(basis, lung, weights);
  return cubic_value(&p, scale);
}

supine_status supine_basis_scale(const supine_basis *basis, const double *weights, double volume,
                                 double *scale, supine_error *error) {
  const supine_status status = need_volume(basis, error);
  if (status != SUPINE_OK) {
    return status;
  }
  cubic sum = {0, 0, 0};
  for (size_t i = 0; i < basis->info.lung_count; ++i) {
    const cubic p = lung_cubic(basis, i, weights);
    sum.a += p.a;
    sum.b += p.b;
    sum.c += p.c;
  }
  return cubic_root(&sum, volume, scale, error);
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
  const cubic p = lung_cubic(basis, lung, weights);
  return cubic_root(&p, volume, scale, error);
}
