/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Gravity in the body from exact or faulty rotations. */
#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "sh/base/vec3.h"

#include "program/stream/gravity.h"

/* 32-bit floats leave 1e-6, trackers' own arithmetic up to about 1e-4. */
static const double slack = 1e-3;
/* A calibration that stretches by a tenth is poor, yet its rotation is still within degrees. */
static const double sheared = 0.1;

supine_stream_setup supine_stream_setup_default(void) {
  return (supine_stream_setup){.down = {0, 0, -1}, .body = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
}

void supine_stream_rotation(const double q[4], double r[9]) {
  const double w = q[0];
  const double x = q[1];
  const double y = q[2];
  const double z = q[3];
  const double rows[9] = {
      1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
      2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
      2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
  memcpy(r, rows, sizeof rows);
}

/* Cofactors, so that m^-T = cofactors / determinant. */
static double cofactors(const double m[9], double c[9]) {
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      const int a = (i + 1) % 3;
      const int b = (i + 2) % 3;
      const int u = (j + 1) % 3;
      const int v = (j + 2) % 3;
      c[3 * i + j] = m[3 * a + u] * m[3 * b + v] - m[3 * a + v] * m[3 * b + u];
    }
  }
  return supine_dot(m, c);
}

static bool all_finite(const double *numbers, int count) {
  for (int i = 0; i < count; ++i) {
    if (!isfinite(numbers[i])) {
      return false;
    }
  }
  return true;
}

static double norm(const double *v, int count) {
  double sum = 0.0;
  for (int i = 0; i < count; ++i) {
    sum += v[i] * v[i];
  }
  return sqrt(sum);
}

/* The rotation Q of m = Q S, by Newton's iteration X <- (X + X^-T) / 2, which begins near enough to
 * end after a few steps. `m` has determinant > 0 and size about 1. */
static void nearest(const double m[9], double q[9]) {
  memcpy(q, m, 9 * sizeof *q);
  for (int step = 0; step < 50; ++step) {
    double c[9];
    const double determinant = cofactors(q, c);
    double change = 0.0;
    for (int i = 0; i < 9; ++i) {
      const double next = 0.5 * (q[i] + c[i] / determinant);
      change = fmax(change, fabs(next - q[i]));
      q[i] = next;
    }
    if (change < 1e-15) {
      return;
    }
  }
}

static void apply(const double m[9], const double v[3], double out[3]) {
  for (int i = 0; i < 3; ++i) {
    out[i] = m[3 * i] * v[0] + m[3 * i + 1] * v[1] + m[3 * i + 2] * v[2];
  }
}

supine_stream_verdict supine_stream_gravity_rotation(const supine_stream_setup *setup,
                                                     const double rotation[9], double gravity[3],
                                                     const char **why) {
  const double size = norm(rotation, 9) / sqrt(3.0);
  *why = "it is not finite";
  if (!all_finite(rotation, 9) || !isfinite(size)) {
    return SUPINE_STREAM_REFUSED;
  }
  *why = "it is singular";
  if (!(size > 1e-6)) {
    return SUPINE_STREAM_REFUSED;
  }
  double even[9];
  double c[9];
  for (int i = 0; i < 9; ++i) {
    even[i] = rotation[i] / size;
  }
  const double determinant = cofactors(even, c);
  *why = determinant < 0.0 ? "it mirrors" : "it is singular";
  if (!(determinant > 0.1)) { /* 1 for a rotation; a shear of a tenth leaves 0.98 */
    return SUPINE_STREAM_REFUSED;
  }
  double q[9];
  nearest(even, q);
  double stretch = 0.0; /* of S = Q^T m / size, which is 1 for a rotation */
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      const double s = q[i] * even[j] + q[3 + i] * even[3 + j] + q[6 + i] * even[6 + j];
      stretch = fmax(stretch, fabs(s - (i == j ? 1.0 : 0.0)));
    }
  }
  *why = "it shears";
  if (!(stretch <= sheared)) {
    return SUPINE_STREAM_REFUSED;
  }
  double falls[3];
  const double transposed[9] = {q[0], q[3], q[6], q[1], q[4], q[7], q[2], q[5], q[8]};
  apply(transposed, setup->down, falls);
  const supine_stream_verdict verdict = supine_stream_gravity_down(setup, falls, gravity, why);
  if (verdict != SUPINE_STREAM_EXACT || (stretch <= slack && fabs(size - 1.0) <= slack)) {
    return verdict;
  }
  *why = stretch <= slack ? "it scales" : "it shears a little";
  return SUPINE_STREAM_REPAIRED;
}

supine_stream_verdict supine_stream_gravity_quaternion(const supine_stream_setup *setup,
                                                       const double quaternion[4],
                                                       double gravity[3], const char **why) {
  const double size = norm(quaternion, 4);
  *why = "its quaternion is zero or not finite";
  if (!isfinite(size) || !(size > 1e-6)) {
    return SUPINE_STREAM_REFUSED;
  }
  double unit[4];
  for (int i = 0; i < 4; ++i) {
    unit[i] = quaternion[i] / size;
  }
  double rotation[9];
  supine_stream_rotation(unit, rotation);
  const supine_stream_verdict verdict =
      supine_stream_gravity_rotation(setup, rotation, gravity, why);
  if (verdict != SUPINE_STREAM_EXACT || fabs(size - 1.0) <= slack) {
    return verdict;
  }
  *why = "its quaternion is not of length 1";
  return SUPINE_STREAM_REPAIRED;
}

supine_stream_verdict supine_stream_gravity_down(const supine_stream_setup *setup,
                                                 const double down[3], double gravity[3],
                                                 const char **why) {
  const double size = supine_length(down);
  *why = "it points nowhere";
  if (!isfinite(size) || !(size > 1e-9)) {
    return SUPINE_STREAM_REFUSED;
  }
  const double unit[3] = {down[0] / size, down[1] / size, down[2] / size};
  double turned[3];
  apply(setup->body, unit, turned);
  const double length = supine_length(turned); /* 1 but for rounding */
  for (int i = 0; i < 3; ++i) {
    gravity[i] = turned[i] / length;
  }
  *why = NULL;
  return SUPINE_STREAM_EXACT;
}

double supine_stream_gravity_smooth(const double gravity[3], double step, double seconds,
                                    double smooth[3]) {
  double cross[3];
  supine_cross(smooth, gravity, cross);
  const double cosine = supine_dot(smooth, gravity);
  const double sine = supine_length(cross);
  const double angle = atan2(sine, cosine);
  const double share = seconds > 0.0 ? -expm1(-step / seconds) : 1.0;
  if (share >= 1.0 || sine < 1e-12) { /* there, or opposite: no arc is shorter than another */
    memcpy(smooth, gravity, 3 * sizeof *smooth);
    return 0.0;
  }
  const double a = sin((1.0 - share) * angle) / sine;
  const double b = sin(share * angle) / sine;
  for (int i = 0; i < 3; ++i) {
    smooth[i] = a * smooth[i] + b * gravity[i];
  }
  const double length = supine_length(smooth);
  for (int i = 0; i < 3; ++i) {
    smooth[i] /= length;
  }
  return (1.0 - share) * angle;
}
