/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file The displacement law of one patient, from that person's scans and landmarks
 * ([Santhanam2008] IV-B): a formula with nine constants, and a correction that interpolates the
 * residual of the formula.
 *
 * The law gives the displacement u from the fuller of two states to the emptier one. X, Y and Z are
 * the box coordinates of lungs.h in the box of the fuller state. `side` is +1 in the left lung and
 * -1 in the right. The correction r is a sum of kernels (krige.h):
 *
 *     u = (1 + c7 (X-1/2) + c8 (Y-1/2) + c9 (Z-1/2)) (side c1 X^c2, -c3 Y^c4, -c5 Z^c6) + r
 *
 * The first factor is the force (18) of [Santhanam2008], scaled to 1 at the box's centre; the
 * second is the direction (15)-(17). */
#ifndef SUPINE_PATIENT_H
#define SUPINE_PATIENT_H

#include <stddef.h>

#include "precompute/lungs/lungs.h"
#include "precompute/physics/force.h"

typedef enum supine_patient_law {
  SUPINE_PATIENT_DEEP = 0, /**< the default law (deep, model.h) or one close to it */
  SUPINE_PATIENT_PAPER,    /**< all nine constants are fitted */
  SUPINE_PATIENT_LAW_COUNT
} supine_patient_law;

extern const char *const supine_patient_law_names[SUPINE_PATIENT_LAW_COUNT + 1];

/** Motion of the body that is fitted between two scans; the value is the number of unknowns. */
typedef enum supine_patient_scan_motion {
  SUPINE_PATIENT_STILL = 0,
  SUPINE_PATIENT_TRANSLATION = 3,
  SUPINE_PATIENT_RIGID = 6
} supine_patient_scan_motion;

/** Bounding box of the lungs in the fuller of a patient's two scanned states, mm. */
typedef struct supine_patient_frame {
  double minimum[3], maximum[3];
  double midline; /**< x of the plane between the lungs, mm */
  int only_side;  /**< +1 if only the left lung is given, -1 if only the right, 0 for both lungs */
} supine_patient_frame;

enum {
  SUPINE_PATIENT_CONSTANTS = 9,
  SUPINE_PATIENT_COLUMNS = 4, /**< number of terms of the force: 1, X - 1/2, Y - 1/2, Z - 1/2 */
  SUPINE_PATIENT_CENTRES_MAX = 900
};

/** Constants of a displacement law, and the motion of the body between the two scans. */
typedef struct supine_patient_power {
  double c[SUPINE_PATIENT_CONSTANTS]; /**< c1 to c9; c1, c3 and c5 are lengths, mm */
  double motion[6]; /**< translation (mm), then small rotation (rad) about the box's centre */
} supine_patient_power;

/** Kernel of the correction of a displacement law. */
typedef struct supine_patient_centre {
  double offset[3]; /**< position from the box's centre, mm */
  double side;      /**< +1 left lung, -1 right lung */
  double size;      /**< length of the displacement without the correction, mm */
  double weight[3]; /**< x, y, z: factors on the covariance with this kernel, 1/mm */
} supine_patient_centre;

typedef struct supine_patient {
  supine_patient_law law;
  supine_patient_frame frame;
  supine_patient_power power;
  size_t centre_count; /**< number of kernels, or 0 without a correction */
  supine_patient_centre centre[SUPINE_PATIENT_CENTRES_MAX];
} supine_patient;

/** A point in the coordinates of a displacement law. */
typedef struct supine_patient_place {
  double box[3];                        /**< X, Y, Z, each 0 to 1 in the box */
  double side;                          /**< +1 left lung, -1 right lung */
  double offset[3];                     /**< position from the box's centre, mm */
  double force[SUPINE_PATIENT_COLUMNS]; /**< terms of the force at this point */
} supine_patient_place;

/** Convert a point to a place, whose `force` is not spread over the surface. Outside the box,
 * `force` is that of the nearest point of the box.
 * @param point  mm
 * @param side   +1 left lung, -1 right lung, 0 to let the midline decide */
supine_patient_place supine_patient_find(const supine_patient_frame *frame, const double point[3],
                                         double side);

/** Make a frame from landmarks [count, 3], mm: the box of the landmarks, 10 mm larger on every
 * side, because lungs extend beyond landmarks.
 * @param midline  x of the plane between the lungs, mm, or NULL for the box's centre */
supine_patient_frame supine_patient_frame_of_points(size_t count, const double *points,
                                                    const double *midline);

supine_patient_frame supine_patient_frame_of_lungs(const supine_lungs *lungs);

/** Return the side of a vertex's lung: +1 left, -1 right. */
int supine_patient_side_of(const supine_lungs *lungs, size_t vertex);

supine_patient_place supine_patient_find_vertex(const supine_lungs *lungs, size_t vertex);

/** Express the default law (deep, model.h) by nine constants.
 * @param gravity    unit vector, or 0,0,0 for supine
 * @param path_span  gains of the emptier state minus those of the fuller state, along x, y and z
 *   (supine_patient_path); 0,0,0 counts as 1,1,1 */
supine_patient_power supine_patient_deep(const double gravity[3], const double path_span[3]);

/** Compute the force at a place, [Santhanam2008] (18). */
double supine_patient_force_at(const supine_patient_power *power,
                               const supine_patient_place *place);

/** Compute d: `force` times the direction of displacement, [Santhanam2008] (15)-(17), in mm. */
void supine_patient_direction(const supine_patient_power *power, const supine_patient_place *place,
                              double force, double d[3]);

/** Compute the displacement of a place by the motion between the scans, mm. */
void supine_patient_motion(const supine_patient_power *power, const supine_patient_place *place,
                           double u[3]);

/** Compute the covariances [count] between the correction at one place and the corrections at
 * `count` kernels, along one axis, mm^2. */
void supine_patient_covariances(const supine_patient_centre *here, size_t count,
                                const supine_patient_centre *centre, double *covariance);

/** Compute the displacement u of a place, mm, with the correction but without the motion between
 * the scans.
 * @param spread  factor on the force */
void supine_patient_displacement(const supine_patient *patient, const supine_patient_place *place,
                                 double spread, double u[3]);

/** Find where a point of the emptier state lies in the fuller state, by fixed-point iteration.
 * @param side    +1 left lung, -1 right lung, 0 to let the midline decide
 * @param spread  factor on the force
 * @param at      in: initial guess; out: position in the fuller state, mm
 * @param u       written: displacement from the fuller to the emptier state, mm */
void supine_patient_find_in_fuller(const supine_patient *patient, const double point[3],
                                   double side, double spread, double at[3], double u[3]);

/** Move points [count, 3] of the emptier state to their positions in the fuller state, mm. */
void supine_patient_points_to_fuller(const supine_patient *patient, size_t count, double *points);

/** Split the force of a displacement law into a part that follows gravity, with the factor `gain`,
 * and a part that is fixed to the body. In the fitted posture, the sum does not depend on `gain`.
 * @param gravity  unit vector in the fitted posture */
supine_force_law supine_patient_force(const supine_patient_power *power, double gain,
                                      const double gravity[3]);

#endif
