/* SPDX-License-Identifier: MIT */
/** @file
 * The direction of gravity in a posture, a DICOM patient position, an orientation or a tilt.
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

/** Find gravity in a named posture, in upper or lower case:
 *
 *     supine  HFS  FFS    (0, 1, 0)      left   left-lateral   HFDL  FFDL   ( 1, 0, 0)
 *     prone   HFP  FFP    (0,-1, 0)      right  right-lateral  HFDR  FFDR   (-1, 0, 0)
 *     upright             (0, 0,-1)      inverted                           (0, 0, 1)
 *
 * "left" is lying on the left side. The capitals are DICOM patient positions (0018,5100); head or
 * feet first makes no difference to gravity.
 * @param gravity  [3] unit vector, written
 * @retval SUPINE_ERROR_ARGUMENT  the name is unknown; `gravity` is unchanged */
SUPINE_API supine_status supine_posture_gravity(const char *name, double gravity[3]);

/** Return the number of names that supine_posture_gravity knows. */
SUPINE_API size_t supine_posture_count(void);

/** Return the posture name with an index, in lower case except DICOM's; NULL past the last. */
SUPINE_API const char *supine_posture_name(size_t index);

/** Return the posture name nearest to `name`, by the number of characters to insert, delete or
 * replace, for a suggestion; never NULL. */
SUPINE_API const char *supine_posture_nearest(const char *name);

/** Compute gravity for a body's orientation, a rotation from body axes to world axes, in a world
 * whose z points up:
 *
 *     gravity = R^T (0, 0, -1)         R: v_world = R v_body
 *
 * The identity (1, 0, 0, 0) is upright; a turn about the world's z changes nothing.
 *
 * @param quaternion  W, X, Y, Z of any length but 0
 * @param gravity     [3] unit vector, written
 * @retval SUPINE_ERROR_ARGUMENT  the quaternion is zero or not finite */
SUPINE_API supine_status supine_posture_quaternion(const double quaternion[4], double gravity[3]);

/** Turn gravity by t = `degrees` about the left-right axis, in the sagittal plane, from posterior
 * towards the head:
 *
 *     (x, y, z) -> (x, y cos t - z sin t, y sin t + z cos t)
 *
 * Supine with +15 degrees is Trendelenburg, head down: (0, cos 15, sin 15). As gravity turns in the
 * axes of the body, a positive angle lowers the feet from prone and leans the body back from
 * upright; a lateral posture does not change.
 *
 * @param tilted  [3], written; may be `gravity`
 * @retval SUPINE_ERROR_ARGUMENT  gravity or the angle is not finite */
SUPINE_API supine_status supine_posture_tilt(const double gravity[3], double degrees,
                                             double tilted[3]);

#ifdef __cplusplus
}
#endif
#endif
