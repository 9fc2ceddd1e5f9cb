/* SPDX-License-Identifier: MIT */
/** @file
 * Directions of gravity: by posture, by DICOM patient position, by orientation, by tilt.
 *
 * Gravity is a unit vector in body axes (DICOM LPS: +x left, +y posterior, +z head) that points
 * where things fall. */
#ifndef SUPINE_POSTURE_H
#define SUPINE_POSTURE_H

#include <stddef.h>

#include <supine/status.h>

#ifdef __cplusplus
extern "C" {
#endif

/** Gravity in a named posture, upper or lower case:
 *
 *     supine  HFS  FFS    (0, 1, 0)      left   left-lateral   HFDL  FFDL   ( 1, 0, 0)
 *     prone   HFP  FFP    (0,-1, 0)      right  right-lateral  HFDR  FFDR   (-1, 0, 0)
 *     upright             (0, 0,-1)      inverted                           (0, 0, 1)
 *
 * left: lying on the left side. The capitals are DICOM patient positions (0018,5100); head or feet
 * first makes no difference to gravity.
 * @retval SUPINE_ERROR_ARGUMENT  no such posture; `gravity` is untouched */
SUPINE_API supine_status supine_posture_gravity(const char *name, double gravity[3]);

/** Number of names that supine_posture_gravity knows. */
SUPINE_API size_t supine_posture_count(void);

/** Name number `index`, in lower case but for the DICOM codes; NULL past the last. */
SUPINE_API const char *supine_posture_name(size_t index);

/** The known name that takes the fewest insertions, deletions and replacements of a character to
 * turn `name` into; never NULL. For "did you mean ...?". */
SUPINE_API const char *supine_posture_nearest(const char *name);

/** Gravity of a body whose orientation is a rotation from body axes to world axes, in a world
 * whose z points up:
 *
 *     gravity = R^T (0, 0, -1)         R: v_world = R v_body
 *
 * The identity (1, 0, 0, 0) is upright; turning the body about the world's z changes nothing.
 *
 * @param quaternion  W, X, Y, Z; any length but 0
 * @retval SUPINE_ERROR_ARGUMENT  zero or not finite */
SUPINE_API supine_status supine_posture_quaternion(const double quaternion[4], double gravity[3]);

/** Gravity turned about the left-right axis, in the sagittal plane, from posterior towards head:
 *
 *     (x, y, z) -> (x, y cos t - z sin t, y sin t + z cos t)
 *
 * Supine with +15 degrees is Trendelenburg, head down: (0, cos 15, sin 15). The turn is of gravity
 * in the body's axes whatever the posture: from prone the same sign lowers the feet, from upright
 * it leans the body back; a lateral posture does not change.
 *
 * @param tilted  [3], written; may be `gravity`
 * @retval SUPINE_ERROR_ARGUMENT  not finite */
SUPINE_API supine_status supine_posture_tilt(const double gravity[3], double degrees,
                                             double tilted[3]);

#ifdef __cplusplus
}
#endif
#endif
