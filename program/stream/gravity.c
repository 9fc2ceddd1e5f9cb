/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute the direction of gravity in body axes from the pose of a tracker. */
#include <math.h>
#include <stddef.h>

#include "base/vec3.h"

#include "program/stream/gravity.h"

static const double repaired_max = 0.1; /* a matrix with more stretch or shear is refused */

supine_stream_setup supine_stream_setup_default(void) {
  return (supine_stream_setup){.down = {0, 0, -1}, .body = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
}

/* Compute out = M^T v, for M stored row by row. */
static void apply_transpose(const double m[9], const double v[3], double out[3]) {
  for (int i = 0; i < 3; ++i) {
    out[i] = m[i] * v[0] + m[3 + i] * v[1] + m[6 + i] * v[2];
  }
}

supine_stream_verdict supine_stream_gravity_rotation(const supine_stream_setup *setup,
                                                     const double rotation[9], double gravity[3],
                                                     const char **why) {
  double scale = 0.0;
  const double strain = supine_matrix_strain(rotation, &scale);
  *why = "its matrix is zero or not finite; send a rotation";
  if (!(fabs(scale) > 1e-6) || !isfinite(scale)) {
    return SUPINE_STREAM_REFUSED;
  }
  *why = "its matrix has stretch or shear; send a rotation";
  if (!(strain <= repaired_max)) {
    return SUPINE_STREAM_REFUSED;
  }
  *why = "its matrix has a reflection; send a rotation";
  if (scale < 0.0) {
    return SUPINE_STREAM_REFUSED;
  }
  double tracker_down[3];
  apply_transpose(rotation, setup->down, tracker_down);
  const supine_stream_verdict verdict =
      supine_stream_gravity_down(setup, tracker_down, gravity, why);
  if (verdict != SUPINE_STREAM_EXACT ||
      (strain <= SUPINE_ROTATION_TOLERANCE && fabs(scale - 1.0) <= SUPINE_ROTATION_TOLERANCE)) {
    return verdict;
  }
  *why = strain <= SUPINE_ROTATION_TOLERANCE ? "its scale is not 1"
                                             : "its matrix has slight stretch or shear";
  return SUPINE_STREAM_REPAIRED;
}

supine_stream_verdict supine_stream_gravity_down(const supine_stream_setup *setup,
                                                 const double down[3], double gravity[3],
                                                 const char **why) {
  double unit[3];
  double turned[3];
  *why = "its direction is zero or not finite; send a vector along gravity";
  if (!supine_normalise(down, unit)) {
    return SUPINE_STREAM_REFUSED;
  }
  for (int i = 0; i < 3; ++i) {
    turned[i] = supine_dot(setup->body + 3 * i, unit);
  }
  (void)supine_normalise(turned, gravity); /* removes rounding errors of the length */
  *why = NULL;
  return SUPINE_STREAM_EXACT;
}
