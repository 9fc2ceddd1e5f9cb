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

/** Compute gravity in body axes for a body that an engine or a headset has rotated by R, a rotation
 * that takes a vector from the axes of the body's object to those of the world: v_world = R v_object.
 *
 *     gravity = -B R^T up
 *
 * B takes a vector from the object's axes to body axes. `axes` names it by which way an object that
 * stands without rotation (R = 1) faces, and by where its left, back and head are:
 *
 *     axes     left  back  head   objects of                                         faces  hand
 *     lps       x     y     z     DICOM, the axes of this library                    -y     right
 *     unity    -x    -z     y     Unity                                              +z     left
 *     unreal   -y    -x     z     Unreal Engine                                      +x     left
 *     three     x    -z     y     three.js, glTF, faces in ARKit                     +z     right
 *     headset  -x     z     y     viewers in WebXR, OpenXR, visionOS; three's camera -z     right
 *
 * R is as the engine has it: a left-handed engine's rotation is no reflection. Give the conjugate of
 * a quaternion, or the transposed matrix, that goes from the world to the body. Turning the body
 * about `up` changes nothing.
 * @param rotation  [count] R: a unit quaternion W, X, Y, Z, or a matrix, row by row; three.js and
 *                  glTF store matrices column by column
 * @param count     4 or 9
 * @param up        [3] direction that points up, in the axes of the world, of any length but 0:
 *                  (0, 0, 1) in Unreal Engine, (0, 1, 0) in the others
 * @param axes      name of the object's axes, in upper or lower case
 * @param gravity   [3] unit vector, written
 * @retval SUPINE_ERROR_ARGUMENT  R deviates from a rotation by more than 0.001 (a quaternion that is
 *                                not of unit length, a scale, a shear), is mirrored or not finite,
 *                                `up` is zero or not finite, or the name or the count is unknown */
SUPINE_API supine_status supine_posture_rotation(const double *rotation, size_t count,
                                                 const double up[3], const char *axes,
                                                 double gravity[3], supine_error *error);

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
