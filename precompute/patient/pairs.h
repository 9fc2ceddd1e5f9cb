/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Matched points of one person in two states. */
#ifndef SUPINE_PATIENT_PAIRS_H
#define SUPINE_PATIENT_PAIRS_H

#include <stdbool.h>
#include <stddef.h>

#include <supine/status.h>

/** Points and where each is found in the other state, mm, LPS. Zero-initialise. */
typedef struct supine_patient_pairs {
  size_t count;
  double *from; /**< [count, 3] at rest */
  double *to;   /**< [count, 3] in the other state */
  double *side; /**< [count] +1 left lung, -1 right; NULL: by the midline */
} supine_patient_pairs;

/** Reads matched points from CSV with the columns x,y,z,to_x,to_y,to_z (from rest to the other
 * state), or im1_x,im1_y,im1_z,im2_x,im2_y,im2_z (image 1 inhaled, image 2 exhaled: from image 2 to
 * image 1).
 *
 * @param reverse  from the other state to rest instead
 * @param pairs    zeroed; written on success alone
 * @retval SUPINE_ERROR_READ    missing or unreadable
 * @retval SUPINE_ERROR_FORMAT  no such columns, a number that is not finite (line named), no pairs,
 *                              a point that is there twice (both lines named)
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_patient_pairs_load(const char *path, bool reverse, supine_patient_pairs *pairs,
                                        supine_error *error);
void supine_patient_pairs_free(supine_patient_pairs *pairs);

/** Swap the two states. */
void supine_patient_pairs_swap(supine_patient_pairs *pairs);

/** Compute how much larger the other state is: the determinant of the affine map that fits best.
 * @return 1 where the points determine none */
double supine_patient_pairs_growth(const supine_patient_pairs *pairs);

/** Whether the pairs can be two states of one chest: judged by the affine map that fits them best.
 *
 * @param moved  a motion between the scans is to be found as well (translation, rotation)
 * @retval SUPINE_ERROR_FORMAT  fewer than 12 pairs, all in one plane, units that differ or cannot
 *                              be mm, sides or axes that differ, frames that do not overlap (unless
 *                              moved), nothing that moves
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_patient_pairs_check(const supine_patient_pairs *pairs, bool moved,
                                         supine_error *error);

#endif
