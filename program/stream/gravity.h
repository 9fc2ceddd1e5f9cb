/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Where gravity points in the body, from what a tracker or a tilt sensor says.
 *
 *     gravity = B R^T down        R: v_world = R v_tracker,  B: v_body = B v_tracker
 *
 * Body axes are DICOM LPS. Only tilt matters: turning about `down` changes nothing. */
#ifndef SUPINE_STREAM_GRAVITY_H
#define SUPINE_STREAM_GRAVITY_H

/** How the tracker is set up. */
typedef struct supine_stream_setup {
  double down[3]; /**< where things fall, in the tracker's world; unit */
  double body[9]; /**< B, rows */
} supine_stream_setup;

/** World z up, and the tracked marker's axes those of the body. */
supine_stream_setup supine_stream_setup_default(void);

/** The rotation of a unit quaternion W, X, Y, Z, rows. */
void supine_stream_rotation(const double quaternion[4], double rotation[9]);

/** Verdict on a pose. */
typedef enum supine_stream_verdict {
  SUPINE_STREAM_EXACT = 0,
  SUPINE_STREAM_REPAIRED, /**< not quite a rotation: the nearest one was taken */
  SUPINE_STREAM_REFUSED   /**< `gravity` is untouched */
} supine_stream_verdict;

/** Of a matrix R. Within 0.001 of a rotation in every stretch it is taken as one (its nearest); one
 * that is scaled evenly, or unevenly by at most a tenth, is repaired. Refused: not finite,
 * singular, mirrored, sheared.
 * @param why  written where the verdict is not exact */
supine_stream_verdict supine_stream_gravity_rotation(const supine_stream_setup *setup,
                                                     const double rotation[9], double gravity[3],
                                                     const char **why);

/** Of a quaternion W, X, Y, Z: any length but 0; one that is more than 0.001 off 1 is repaired. */
supine_stream_verdict supine_stream_gravity_quaternion(const supine_stream_setup *setup,
                                                       const double quaternion[4],
                                                       double gravity[3], const char **why);

/** Of the direction in which things fall, in the tracker's axes; any length but 0. */
supine_stream_verdict supine_stream_gravity_down(const supine_stream_setup *setup,
                                                 const double down[3], double gravity[3],
                                                 const char **why);

/** Moves `smooth` towards `gravity` as a first-order lag of `seconds` would over `step`: along the
 * arc, by a share 1 - exp(-step / seconds) of it. Behind a steady turn it stays `seconds` behind.
 * @return the angle that is left, radians */
double supine_stream_gravity_smooth(const double gravity[3], double step, double seconds,
                                    double smooth[3]);

#endif
