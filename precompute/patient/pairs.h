/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Read and check matched points of one person in two states, and fit maps between them. */
#ifndef SUPINE_PATIENT_PAIRS_H
#define SUPINE_PATIENT_PAIRS_H

#include <stdbool.h>
#include <stddef.h>

#include "mesh/mesh.h"

/** Positions of the same points in two states, mm, LPS. Initialise to zero. */
typedef struct supine_patient_pairs {
  size_t count;
  double *from; /**< [count, 3] points in the first state */
  double *to;   /**< [count, 3] points in the second state */
  int *side;    /**< [count] +1 left lung, -1 right lung; NULL if the midline decides */
} supine_patient_pairs;

/** Read pairs of points from a CSV file with the columns x,y,z,to_x,to_y,to_z (first and second
 * state) or im1_x,im1_y,im1_z,im2_x,im2_y,im2_z (image 1 is the second state, usually inhaled;
 * image 2 is the first).
 * @param reverse  exchange the two states
 * @param pairs    initialised to zero; empty after a failure */
supine_status supine_patient_pairs_load(const char *path, bool reverse, supine_patient_pairs *pairs,
                                        supine_error *error);
void supine_patient_pairs_free(supine_patient_pairs *pairs);

/** Keep at most `most` pairs, spread evenly over the lungs, in their order: each next one is the
 * pair whose first point lies farthest from those of the pairs already chosen. Cost: `most`
 * distances for each pair.
 * @return SUPINE_ERROR_MEMORY or SUPINE_OK */
supine_status supine_patient_pairs_thin(supine_patient_pairs *pairs, size_t most,
                                        supine_error *error);

/** Estimate the volume of the second state divided by that of the first: the determinant of the
 * best-fitting affine map.
 * @return 1 if the points do not determine a map, or if the map is a reflection */
double supine_patient_pairs_growth(const supine_patient_pairs *pairs);

/** Check that at least 12 pairs of points can be positions in two states of one chest. Refuse other
 * units than mm, exchanged sides or axes, and frames that do not overlap (unless scans_moved).
 * @param scans_moved  the body may have moved between the scans */
supine_status supine_patient_pairs_check(const supine_patient_pairs *pairs, bool scans_moved,
                                         supine_error *error);

/** Maps from one state to the other: the prediction of a displacement law, three baselines to
 * compare it with, and a rotation with translation. */
typedef enum supine_patient_map {
  SUPINE_PATIENT_MAP_PREDICTED = 0,
  SUPINE_PATIENT_MAP_NONE,
  SUPINE_PATIENT_MAP_TRANSLATION,
  SUPINE_PATIENT_MAP_AFFINE,
  SUPINE_PATIENT_MAP_COUNT,
  SUPINE_PATIENT_MAP_RIGID = SUPINE_PATIENT_MAP_COUNT
} supine_patient_map;

/** The map x -> m x + t, with the matrix m in row-major order. */
typedef struct supine_patient_affinity {
  double m[9], t[3];
} supine_patient_affinity;

/** Fit a map of the given kind from points `from` to points `to` [count, 3], by least squares.
 * @return false if the points do not determine an affine map */
bool supine_patient_map_fit(supine_patient_map kind, size_t count, const double *from,
                            const double *to, supine_patient_affinity *map);
void supine_patient_map_apply(const supine_patient_affinity *map, const double from[3],
                              double to[3]);

/** Check by the overlap of bounding boxes that two surfaces can be two states of the same lungs. */
supine_status supine_patient_check_boxes(const supine_mesh *first, const supine_mesh *second,
                                         supine_error *error);

#endif
