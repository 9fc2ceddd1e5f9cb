/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Read and check matched points of one person in two states, and fit maps between them. */
#ifndef SUPINE_PATIENT_PAIRS_H
#define SUPINE_PATIENT_PAIRS_H

#include <stdbool.h>
#include <stddef.h>

#include "mesh/mesh.h"

/** Points and their places in the other state, mm, LPS. Zero-initialise. */
typedef struct supine_patient_pairs {
  size_t count;
  double *from; /**< [count, 3] at rest */
  double *to;   /**< [count, 3] in the other state */
  double *side; /**< [count] +1 left lung, -1 right; NULL: by the midline */
} supine_patient_pairs;

/** Read matched points from CSV with the columns x,y,z,to_x,to_y,to_z (from rest to the other
 * state), or im1_x,im1_y,im1_z,im2_x,im2_y,im2_z (image 1 inhaled, image 2 exhaled: from image 2
 * to image 1).
 *
 * @param reverse  read them as from the other state to rest
 * @param pairs    zero-initialised; empty after a failure
 * @retval SUPINE_ERROR_READ    the file is missing or unreadable
 * @retval SUPINE_ERROR_FORMAT  no such columns, a number that is not finite (line named), no
 *                              pairs
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_patient_pairs_load(const char *path, bool reverse, supine_patient_pairs *pairs,
                                        supine_error *error);
void supine_patient_pairs_free(supine_patient_pairs *pairs);

/** Compute the volume ratio of the other state to rest: the determinant of the best affine map.
 * @return 1 if the points do not determine a map, or if it is a reflection */
double supine_patient_pairs_growth(const supine_patient_pairs *pairs);

/** Check by the best affine map that the pairs can be two states of one chest.
 *
 * @param moved  the fit allows a motion between the scans (translation, rotation)
 * @retval SUPINE_ERROR_FORMAT  fewer than 12 pairs, all in one plane, units that differ or cannot
 *                              be mm, sides or axes that differ, frames that do not overlap (unless
 *                              moved), no motion */
supine_status supine_patient_pairs_check(const supine_patient_pairs *pairs, bool moved,
                                         supine_error *error);

/** A prediction, and its baselines: maps of one state fitted to the other. */
typedef enum supine_patient_map {
  SUPINE_PATIENT_MAP_PREDICTED = 0,
  SUPINE_PATIENT_MAP_NONE,
  SUPINE_PATIENT_MAP_TRANSLATION,
  SUPINE_PATIENT_MAP_AFFINE,
  SUPINE_PATIENT_MAP_COUNT,
  SUPINE_PATIENT_MAP_RIGID = SUPINE_PATIENT_MAP_COUNT /**< not among the baselines */
} supine_patient_map;

/** The map x -> m x + t, with m by rows. */
typedef struct supine_patient_affinity {
  double m[9], t[3];
} supine_patient_affinity;

/** Fit the map of a kind that brings points [count, 3] nearest to others, by least squares.
 * @return false where an affine map is asked for and the points do not determine it */
bool supine_patient_map_fit(supine_patient_map kind, size_t count, const double *from,
                            const double *to, supine_patient_affinity *map);
void supine_patient_map_apply(const supine_patient_affinity *map, const double from[3],
                              double to[3]);

/** Check by their boxes that two surfaces can be two states of the same lungs.
 * @retval SUPINE_ERROR_MESH  boxes of which less than half of the larger overlaps */
supine_status supine_patient_check_boxes(const supine_mesh *rest, const supine_mesh *state,
                                         supine_error *error);

#endif
