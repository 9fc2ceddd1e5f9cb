/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Compute the direction of gravity in body axes from the messages of a tracker or tilt sensor.
 *
 *     gravity = B R^T down
 *
 * The rotation R maps vectors from tracker axes to world axes, and B from tracker axes to body
 * axes, which are DICOM LPS. `down` is the direction of gravity in world axes. Rotating the tracker
 * about `down` does not change the result. */
#ifndef SUPINE_STREAM_GRAVITY_H
#define SUPINE_STREAM_GRAVITY_H

#include <stdbool.h>

/** How the tracker's axes relate to gravity and to the body. */
typedef struct supine_stream_setup {
  double down[3]; /**< unit vector, direction of gravity in world axes */
  double body[9]; /**< rotation B from tracker axes to body axes, at any scale, row by row */
} supine_stream_setup;

/** Return the default setup: the world's z axis points up, and tracker axes equal body axes. */
supine_stream_setup supine_stream_setup_default(void);

/** Quality of a received pose. */
typedef enum supine_stream_verdict {
  SUPINE_STREAM_EXACT = 0,
  SUPINE_STREAM_REPAIRED, /**< not a rotation, but close enough to one to be used */
  SUPINE_STREAM_REFUSED   /**< unusable; no direction of gravity is computed */
} supine_stream_verdict;

/** Compute the direction of gravity from the matrix R from tracker to world axes, row by row. A
 * matrix that deviates from a rotation by at most 0.001 is accepted as exact. A matrix with a scale
 * other than 1, or with stretch or shear of at most 0.1, is repaired; the direction of gravity then
 * errs by less than 13 degrees. A matrix that is not finite, is singular, contains a reflection, or
 * has more stretch or shear is refused.
 * @param why  set to the reason if the matrix is repaired or refused, otherwise to NULL */
supine_stream_verdict supine_stream_gravity_rotation(const supine_stream_setup *setup,
                                                     const double rotation[9], double gravity[3],
                                                     const char **why);

/** Convert a direction of gravity, of any length but 0, from tracker axes to body axes. */
supine_stream_verdict supine_stream_gravity_down(const supine_stream_setup *setup,
                                                 const double down[3], double gravity[3],
                                                 const char **why);

#endif
