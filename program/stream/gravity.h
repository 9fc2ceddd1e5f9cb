/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Compute the direction of gravity in body axes from the messages of a tracker or tilt sensor.
 *
 *     gravity = B R^T down        R: v_world = R v_tracker,  B: v_body = B v_tracker
 *
 * Body axes are DICOM LPS. A turn about `down` changes nothing. */
#ifndef SUPINE_STREAM_GRAVITY_H
#define SUPINE_STREAM_GRAVITY_H

#include <stdbool.h>

/** Axes of the tracker. */
typedef struct supine_stream_setup {
  double down[3]; /**< direction of gravity in the tracker's world; unit */
  double body[9]; /**< rotation B from tracker to body axes, by rows */
} supine_stream_setup;

/** Return the default setup: z of the world points up, and the marker's axes are the body's. */
supine_stream_setup supine_stream_setup_default(void);

/** Convert a quaternion W, X, Y, Z of any length to a rotation matrix, by rows; return false where
 * it is zero or not finite. */
bool supine_stream_rotation(const double quaternion[4], double rotation[9]);

/** Quality of a received pose. */
typedef enum supine_stream_verdict {
  SUPINE_STREAM_EXACT = 0,
  SUPINE_STREAM_REPAIRED, /**< not a rotation, but near enough to use */
  SUPINE_STREAM_REFUSED   /**< `gravity` is unchanged */
} supine_stream_verdict;

/** Compute gravity from a matrix R. A matrix within 0.001 of a rotation is exact. One that is
 * scaled evenly, or stretched unevenly by at most a tenth, is used as repaired: the direction is
 * then within 3 degrees. A matrix that is not finite, singular, mirrored or sheared is refused.
 * @param why  set to the reason if the pose is repaired or refused, else to NULL */
supine_stream_verdict supine_stream_gravity_rotation(const supine_stream_setup *setup,
                                                     const double rotation[9], double gravity[3],
                                                     const char **why);

/** Compute gravity from a quaternion W, X, Y, Z of any length but 0; a length that differs from 1
 * by more than 0.001 counts as repaired. */
supine_stream_verdict supine_stream_gravity_quaternion(const supine_stream_setup *setup,
                                                       const double quaternion[4],
                                                       double gravity[3], const char **why);

/** Compute gravity from its direction in the tracker's axes, of any length but 0. */
supine_stream_verdict supine_stream_gravity_down(const supine_stream_setup *setup,
                                                 const double down[3], double gravity[3],
                                                 const char **why);

/** Turn `smooth` towards `gravity`, by the share 1 - exp(-step / seconds) of the angle between
 * them: a first-order lag, which follows a steady turn `seconds` late.
 * @param step     time since the last call, s
 * @param seconds  time constant; 0: `smooth` becomes `gravity`
 * @return the remaining angle, radians */
double supine_stream_gravity_smooth(const double gravity[3], double step, double seconds,
                                    double smooth[3]);

#endif
