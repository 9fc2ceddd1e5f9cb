/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file The displacement law of one patient, from that person's scans and landmarks
 * ([Santhanam2008] IV-B): a formula with nine constants, and a correction that interpolates the
 * residual of the formula.
 *
 * The law gives the displacement u from the fuller of two scanned states to the emptier one:
 *
 *     u = (1 + c7 (X-1/2) + c8 (Y-1/2) + c9 (Z-1/2)) (side c1 X^c2, -c3 Y^c4, -c5 Z^c6) + r
 *
 * X, Y and Z are coordinates, 0 to 1, in the bounding box of the lungs in the fuller state. `side`
 * is +1 in the left lung and -1 in the right. c1 to c9 are the constants. r is the correction, a
 * weighted sum of covariance functions (krige.h).
 * The first factor is the force (18) of [Santhanam2008], scaled to 1 at the box's centre; the
 * second is the direction (15)-(17). */
#ifndef SUPINE_PATIENT_H
#define SUPINE_PATIENT_H

#include <stddef.h>

#include "precompute/lungs/lungs.h"
#include "precompute/physics/force.h"

/** What is fitted to a patient: FIT(identifier, name). DEEP: constants at or near those of the
 * default law (model.h). PAPER: nine constants, with a wide prior. */
#define SUPINE_PATIENT_LAWS(FIT) FIT(DEEP, "deep") FIT(PAPER, "paper")

typedef enum supine_patient_law {
#define SUPINE_PATIENT_LAW_ENUM(id, name) SUPINE_PATIENT_##id,
  SUPINE_PATIENT_LAWS(SUPINE_PATIENT_LAW_ENUM)
#undef SUPINE_PATIENT_LAW_ENUM
      SUPINE_PATIENT_LAW_COUNT
} supine_patient_law;

/** Names of the fitted laws, ended by NULL. */
extern const char *const supine_patient_law_names[SUPINE_PATIENT_LAW_COUNT + 1];

/** Motion of the body between two scans, to be fitted. The value is its number of unknowns. */
typedef enum supine_patient_scan_motion {
  SUPINE_PATIENT_STILL = 0,
  SUPINE_PATIENT_TRANSLATION = 3,
  SUPINE_PATIENT_RIGID = 6
} supine_patient_scan_motion;

/** Bounding box of a patient's lungs in the fuller of the two scanned states, mm. */
typedef struct supine_patient_frame {
  double minimum[3], maximum[3];
  double midline; /**< x of the plane between the lungs, mm */
  int only_side;  /**< +1 if only the left lung is given, -1 if only the right, 0 for both lungs */
} supine_patient_frame;

enum {
  SUPINE_PATIENT_CONSTANTS = 9,
  SUPINE_PATIENT_COLUMNS = 4,       /**< the force is a linear function with 4 terms: 1, X, Y, Z */
  SUPINE_PATIENT_CENTRES_MAX = 900, /**< most points of a fit, and centres of its kriging */
  SUPINE_PATIENT_VERTICES_MAX = 600 /**< most of them that are matched vertices of surfaces */
};

/** Constants of a displacement law, and the rigid motion of the body between the two scans. */
typedef struct supine_patient_power {
  double c[SUPINE_PATIENT_CONSTANTS]; /**< c1 to c9 of the formula above; c1, c3 and c5 in mm */
  double motion[6]; /**< translation, mm; small rotation about the lungs' centre, rad */
} supine_patient_power;

/** A point that adds weight * its covariance with p to the kriging correction at every point p. */
typedef struct supine_patient_centre {
  double offset[3]; /**< position relative to the centre of the lungs' bounding box, mm */
  int side;         /**< +1 left lung, -1 right lung */
  double size;      /**< length of the uncorrected displacement at the point, mm */
  double weight[3]; /**< [axis] factor of the covariance, 1/mm */
} supine_patient_centre;

/** A landmark of the fit. */
typedef struct supine_patient_landmark {
  double offset[3]; /**< position relative to the centre of the lungs' bounding box, mm */
  int side;         /**< +1 left lung, -1 right lung */
} supine_patient_landmark;

typedef struct supine_patient {
  supine_patient_law law;
  supine_patient_frame frame;
  supine_patient_power power;
  size_t centre_count; /**< number of points `centre`; 0 if there is no kriging correction */
  supine_patient_centre centre[SUPINE_PATIENT_CENTRES_MAX];
  size_t landmark_count; /**< 0 if there is no kriging correction, or it is one of surfaces alone */
  supine_patient_landmark landmark[SUPINE_PATIENT_CENTRES_MAX];
} supine_patient;

/** Compute the share of the variance of the error that a patient's landmarks leave at places
 * (supine_kriging_share): 1 far from all of them.
 * @param offsets  [count, 3] relative to the centre of the lungs' bounding box, mm
 * @param sides    [count] +1 left lung, -1 right lung
 * @param shares   [count] written */
supine_status supine_patient_shares(const supine_patient *patient, size_t count,
                                    const double *offsets, const int *sides, double *shares,
                                    supine_error *error);

/** A point of a lung, with the variables of the displacement law at this point. */
typedef struct supine_patient_place {
  double box[3];                        /**< X, Y, Z in the lungs' bounding box, each 0 to 1 */
  int side;                             /**< +1 left lung, -1 right lung */
  double offset[3];                     /**< position relative to the lungs' centre, mm */
  double force[SUPINE_PATIENT_COLUMNS]; /**< values of the terms of the force here: 1, X - 1/2, Y -
                                           1/2, Z - 1/2, with X, Y and Z from 0 to 1 in the lungs'
                                           bounding box */
} supine_patient_place;

/** Find the coordinates of a point in the lungs' bounding box, and the variables of the force
 * there. These are not smoothed; outside the box, they are those of the nearest point of the box.
 * @param point  position in the fuller of the two scanned states, mm
 * @param side   +1 left lung, -1 right lung, 0 to choose by the side of the midline */
supine_patient_place supine_patient_find(const supine_patient_frame *frame, const double point[3],
                                         int side);

/** Make a frame from landmarks [count, 3], mm: the bounding box of the landmarks, enlarged by 10 mm
 * on every side, because lungs extend beyond landmarks.
 * @param midline  x of the plane between the lungs, mm, or NULL to find the gap between the lungs
 */
supine_patient_frame supine_patient_frame_of_points(size_t count, const double *points,
                                                    const double *midline);

supine_patient_frame supine_patient_frame_of_lungs(const supine_lungs *lungs);

/** Return the side of a vertex's lung: +1 left, -1 right. */
int supine_patient_side_of(const supine_lungs *lungs, size_t vertex);

supine_patient_place supine_patient_find_vertex(const supine_lungs *lungs, size_t vertex);

/** Compute the nine constants of the default displacement law ("deep", model.h) between two scans.
 * @param gravity    unit vector, or 0,0,0 for supine
 * @param path_span  along x, y and z: share of the displacement from full inflation to rest that
 *   lies between the two scanned states; 0,0,0 counts as 1,1,1 */
supine_patient_power supine_patient_deep(const double gravity[3], const double path_span[3]);

/** Compute the dimensionless force on a point of the lungs by equation (18) of [Santhanam2008]. */
double supine_patient_force_at(const supine_patient_power *power,
                               const supine_patient_place *place);

/** Compute the displacement d = force * direction, mm. The direction, [Santhanam2008] (15)-(17), is
 * the displacement for a dimensionless force of 1. */
void supine_patient_direction(const supine_patient_power *power, const supine_patient_place *place,
                              double force, double d[3]);

/** Compute the displacement u of a point, mm, by the body's rigid motion between the two scans. */
void supine_patient_motion(const supine_patient_power *power, const supine_patient_place *place,
                           double u[3]);

/** Compute the covariances [count], mm^2, of the kriging correction of the displacement, along one
 * axis, at point `here` with the correction at each of the points `centre`. */
void supine_patient_covariances(const supine_patient_centre *here, size_t count,
                                const supine_patient_centre *centre, double *covariance);

/** Compute the displacement u of a point, mm, by the displacement law and its kriging correction,
 * without the rigid motion between the scans.
 * @param force_factor  multiplies the force of the law */
void supine_patient_displacement(const supine_patient *patient, const supine_patient_place *place,
                                 double force_factor, double u[3]);

/** Find where a point of the emptier scanned state lies in the fuller one. Uses fixed-point steps.
 * @param side    +1 left lung, -1 right lung, 0 to choose by the side of the midline
 * @param force_factor  multiplies the force of the displacement law
 * @param at      in: initial guess; out: position in the fuller state, mm
 * @param u       written: displacement from the fuller to the emptier state, mm */
void supine_patient_find_in_fuller(const supine_patient *patient, const double point[3], int side,
                                   double force_factor, double at[3], double u[3]);

/** Move a point of the fuller scanned state to its position in the emptier one, mm.
 * @param side  +1 left lung, -1 right lung, 0 to choose by the side of the midline */
void supine_patient_move_to_emptier(const supine_patient *patient, int side, double point[3]);

/** Move points [count, 3] of the emptier scanned state to their positions in the fuller one, mm. */
void supine_patient_points_to_fuller(const supine_patient *patient, size_t count, double *points);

/** Split the force of a displacement law into a part that depends on gravity and a part that is
 * fixed to the body. In the posture of the fitted scans, the sum does not depend on `gain`.
 * @param gain     increase of the force from the highest to the lowest point; 1 is the mean force
 * @param gravity  unit vector in the posture of the fitted scans */
supine_force_law supine_patient_force(const supine_patient_power *power, double gain,
                                      const double gravity[3]);

#endif
