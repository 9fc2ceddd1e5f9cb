/* SPDX-License-Identifier: MIT */
/** @file
 * Find the direction of gravity in a posture, a DICOM patient position, an orientation, a tilt or a
 * roll.
 *
 * Gravity is a unit vector in body axes (DICOM LPS: +x left, +y posterior, +z head) that points
 * where things fall.
 *
 * Stability: stable. A change before 1.0 needs a new minor version, and CHANGELOG.md says how to
 * move over. */
#ifndef SUPINE_POSTURE_H
#define SUPINE_POSTURE_H

#include <stddef.h>

#include <supine/status.h>

#ifdef __cplusplus
extern "C" {
#endif

/** Find gravity in a posture by its name, in upper or lower case:
 *
 *     supine  HFS  FFS    (0, 1, 0)      left   left-lateral   HFDL  FFDL   ( 1, 0, 0)
 *     prone   HFP  FFP    (0,-1, 0)      right  right-lateral  HFDR  FFDR   (-1, 0, 0)
 *     upright             (0, 0,-1)      inverted                           (0, 0, 1)
 *
 * "left" means lying on the left side. Names in capitals are DICOM patient positions (0018,5100).
 * All sixteen are known. Only their last letters matter: head (HF), feet (FF), left (LF), right
 * (RF), front (AF) or back (PF) first have the same gravity.
 * @param gravity  [3] unit vector, written
 * @retval SUPINE_ERROR_ARGUMENT  the name is unknown; `gravity` is unchanged */
SUPINE_API supine_status supine_posture_gravity(const char *name, double gravity[3]);

/** Return the number of names that supine_posture_gravity knows. */
SUPINE_API size_t supine_posture_count(void);

/** Return the name at `index` among those that supine_posture_gravity knows, or NULL if `index` is
 * too large. Only DICOM's names are in capitals. */
SUPINE_API const char *supine_posture_name(size_t index);

/** Return the posture name most similar to `name`, for a suggestion; NULL if none is close. The
 * most similar name needs the fewest insertions, deletions and replacements of characters.
 * "sitting" and "standing" mean upright. */
SUPINE_API const char *supine_posture_nearest(const char *name);

/** Compute gravity in body axes for a body with the orientation R, a rotation that takes a vector
 * from body axes to world axes: v_world = R v_body. The world's z axis points up:
 *
 *     gravity = R^T (0, 0, -1)
 *
 * The identity (1, 0, 0, 0) is upright. Turning the body about the world's z axis changes nothing.
 * @param quaternion  R as W, X, Y, Z, of any length but 0
 * @param gravity     [3] unit vector, written
 * @retval SUPINE_ERROR_ARGUMENT  the quaternion is zero or not finite */
SUPINE_API supine_status supine_posture_quaternion(const double quaternion[4], double gravity[3]);

/** Tilt the body by the angle t = `degrees`, so that gravity turns towards the head:
 *
 *     (h u, z) -> ((h cos t - z sin t) u, h sin t + z cos t)
 *
 * u is the horizontal direction of gravity, of unit length, and h its part along u. A positive
 * angle lowers the head in all lying postures (supine+15 is Trendelenburg, and left+15 lowers the
 * head on the left side), and leans the body back from upright, where u is posterior.
 * @param degrees  -90 to 90
 * @param tilted   [3], written; may be the array `gravity`
 * @retval SUPINE_ERROR_ARGUMENT  gravity or the angle is not finite, or the angle is beyond 90 */
SUPINE_API supine_status supine_posture_tilt(const double gravity[3], double degrees,
                                             double tilted[3]);

/** Roll the body about its long axis by the angle t = `degrees`, to its left:
 *
 *     (x, y, z) -> (x cos t + y sin t, y cos t - x sin t, z)
 *
 * From supine, 90 degrees are the left side, and -90 degrees the right side.
 * @param degrees  -180 to 180
 * @param rolled   [3], written; may be the array `gravity`
 * @retval SUPINE_ERROR_ARGUMENT  gravity or the angle is not finite, or the angle is beyond 180 */
SUPINE_API supine_status supine_posture_roll(const double gravity[3], double degrees,
                                             double rolled[3]);

#ifdef __cplusplus
}
#endif
#endif
