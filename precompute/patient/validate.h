/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file Measure the error of a prediction against another state of the same lungs, and of maps
 * that are fitted to that state itself. */
#ifndef SUPINE_PATIENT_VALIDATE_H
#define SUPINE_PATIENT_VALIDATE_H

#include "mesh/mesh.h"
#include "precompute/patient/pairs.h"
#include "precompute/patient/patient.h"

/** "predicted", "none", "translation", "rigid+scale", "affine". */
extern const char *const supine_patient_map_names[SUPINE_PATIENT_MAP_COUNT];

/** Check by their boxes that two surfaces can be two states of the same lungs.
 * @retval SUPINE_ERROR_MESH  sizes that differ by more than 1.6 times, or boxes that hardly overlap
 */
supine_status supine_patient_check_boxes(const supine_mesh *rest, const supine_mesh *state,
                                         supine_error *error);

/** Distances, mm. */
typedef struct supine_patient_distance {
  double mean, rms, p95;
  double largest;   /**< of surfaces: Hausdorff distance */
  double explained; /**< explained share of the squared distance without a map, or of that after a
                         translation if motion between the scans is removed; NAN if nothing moved */
} supine_patient_distance;

/** Compute distances of points that are known in both states.
 * @param moved      motion between the scans that is taken out of the prediction, by least squares
 * @param predicted  [count, 3] where the pairs' first points were predicted to go
 * @retval SUPINE_ERROR_NUMERICAL (all in one plane), SUPINE_ERROR_MEMORY */
supine_status supine_patient_validate_points(
    const supine_patient_pairs *pairs, const double *predicted, supine_patient_moved moved,
    supine_patient_distance distance[SUPINE_PATIENT_MAP_COUNT], supine_error *error);

/** Compute distances between surfaces of any meshing, of the vertices of each to the other surface.
 * The maps are fitted by iterated nearest points.
 * @param rest       the surface that motion starts from
 * @param moved      motion between the scans that is taken out of the prediction
 * @param predicted  [rest vertices, 3]; the motion is added to it
 * @param nearest    optional [rest vertices, 3]: the state's point nearest to each predicted one
 * @retval SUPINE_ERROR_MESH  as supine_patient_check_boxes
 * @retval SUPINE_ERROR_NUMERICAL, SUPINE_ERROR_MEMORY */
supine_status
supine_patient_validate_surface(const supine_mesh *rest, supine_patient_moved moved,
                                double *predicted, const supine_mesh *state, double *nearest,
                                supine_patient_distance distance[SUPINE_PATIENT_MAP_COUNT],
                                supine_error *error);

#endif
