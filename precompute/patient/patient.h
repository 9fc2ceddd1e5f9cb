/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file A patient's own law of displacement, from that person's scans and landmarks
 * ([Santhanam2008] IV-B): a law of nine constants, and a correction that interpolates its
 * residual.
 *
 * With X, Y, Z the box coordinates of lungs.h in the box of the fuller of two states, side +1
 * left and -1 right, u is the displacement from the fuller state to the emptier one:
 *
 *     u = (1 + c7 (X-1/2) + c8 (Y-1/2) + c9 (Z-1/2)) (side c1 X^c2, -c3 Y^c4, -c5 Z^c6) + r
 *
 * `deep` takes c2, c4, c6 to c9 and the ratios of the lengths from the deep law (model.h),
 * `paper` fits all nine. The correction r is a sum of kernels (krige.h). The force is scaled to
 * 1 at the box's centre, as only its product with the directions is observable. */
#ifndef SUPINE_PATIENT_H
#define SUPINE_PATIENT_H

#include <stdbool.h>
#include <stddef.h>

#include "precompute/lungs/lungs.h"
#include "precompute/physics/force.h"

typedef enum supine_patient_law {
  SUPINE_PATIENT_DEEP = 0,
  SUPINE_PATIENT_PAPER,
  SUPINE_PATIENT_LAW_COUNT
} supine_patient_law;

/** "deep", "paper". */
extern const char *const supine_patient_law_names[SUPINE_PATIENT_LAW_COUNT + 1];

/** Motion between the scans, which is fitted with the law. */
typedef enum supine_patient_moved {
  SUPINE_PATIENT_STILL = 0,
  SUPINE_PATIENT_TRANSLATION,
  SUPINE_PATIENT_RIGID
} supine_patient_moved;

/** The box of the fuller state, mm. */
typedef struct supine_patient_frame {
  double minimum[3], maximum[3];
  double midline;
  int only_side; /**< +1 left or -1 right if there is only one lung; else 0 */
} supine_patient_frame;

enum {
  SUPINE_PATIENT_CONSTANTS = 9,
  SUPINE_PATIENT_COLUMNS = 4, /**< columns of the force: 1, X - 1/2, Y - 1/2, Z - 1/2 */
  SUPINE_PATIENT_CENTRES_MAX = 900
};

/** The constants of a law, and the motion between the scans. */
typedef struct supine_patient_power {
  double c[SUPINE_PATIENT_CONSTANTS]; /**< c1 to c9; c1, c3 and c5 in mm, negative if the lung
                                         empties; the force is 1 at the box's centre */
  double motion[6]; /**< translation (mm), small rotation (rad) about the box's centre;
                        u + motion is what was measured */
} supine_patient_power;

/** One kernel of the correction. */
typedef struct supine_patient_centre {
  double at[3];     /**< position from the box's centre, mm */
  double side;      /**< lung: +1 left, -1 right */
  double size;      /**< length of the law's displacement, mm */
  double weight[3]; /**< 1/mm */
} supine_patient_centre;

typedef struct supine_patient {
  supine_patient_law law;
  supine_patient_frame frame;
  supine_patient_power power;
  size_t centre_count; /**< 0: no correction */
  supine_patient_centre centre[SUPINE_PATIENT_CENTRES_MAX];
} supine_patient;

/** A point in the coordinates of the laws. */
typedef struct supine_patient_place {
  double box[3];                        /**< X, Y, Z; 0 to 1 inside */
  double side;                          /**< +1 left, -1 right */
  double arm[3];                        /**< position from the box's centre, mm */
  double force[SUPINE_PATIENT_COLUMNS]; /**< columns of the force; of a surface, after spreading */
} supine_patient_place;

/** Find a point's place. Its force is not spread; outside the box it is that of the nearest face.
 * @param side  +1 if the point is in the left lung, -1 in the right; 0: by the midline */
supine_patient_place supine_patient_find(const supine_patient_frame *frame, const double point[3],
                                         double side);

/** Make a frame from points: their box, 10 mm larger on every side, as lungs extend beyond
 * landmarks.
 * @param midline  mm, or NULL: the box's centre */
supine_patient_frame supine_patient_frame_of_points(size_t count, const double *points,
                                                    const double *midline);

/** Make the frame of a surface: its lungs' box and midline. */
supine_patient_frame supine_patient_frame_of_lungs(const supine_lungs *lungs);

/** Find the side of a vertex: 1 left, -1 right. */
int supine_patient_side_of(const supine_lungs *lungs, size_t vertex);

/** Find the place of a vertex in the box of its own lungs. */
supine_patient_place supine_patient_find_vertex(const supine_lungs *lungs, size_t vertex);

/** Express the deep law by nine constants for gravity along a unit vector (all 0: supine).
 * @param way  factors on its lengths along x, y and z: the difference between the two states' gains
 *             on the path from full inflation to rest (all 0: 1) */
supine_patient_power supine_patient_deep(const double gravity[3], const double way[3]);

/** Compute (18) of the law at a place. */
double supine_patient_force_at(const supine_patient_power *power,
                               const supine_patient_place *place);

/** Compute (15)-(17) of the law at a place, mm, times a force. */
void supine_patient_direction(const supine_patient_power *power, const supine_patient_place *place,
                              double force, double d[3]);

/** Compute the motion between the scans at a place, mm. */
void supine_patient_motion(const supine_patient_power *power, const supine_patient_place *place,
                           double u[3]);

/** Compute the covariance of the correction along one axis between two centres, mm^2. */
double supine_patient_covariance(const supine_patient_centre *a, const supine_patient_centre *b);

/** Compute the displacement u at a place, mm, with the correction but without the motion between
 * the scans.
 * @param spread  factor on the law's force */
void supine_patient_displacement(const supine_patient *patient, const supine_patient_place *place,
                                 double spread, double u[3]);

/** Find where a point of the emptier state was in the fuller one, by fixed-point iteration.
 * @param side    +1 left lung, -1 right; 0: by the midline
 * @param spread  factor on the law's force: spread force over (18)
 * @param at      in: a first guess; out: position in the fuller state, mm
 * @param u       written: displacement from there, mm */
void supine_patient_settle(const supine_patient *patient, const double point[3], double side,
                           double spread, double at[3], double u[3]);

/** Move points [count, 3] of the emptier state to their places in the fuller one. */
void supine_patient_refer(const supine_patient *patient, size_t count, double *points);

/** Split the force of a patient's law into a part that follows gravity, of slope `gain`, and one
 * that is fixed to the body. In the fitted posture their sum does not depend on the gain. */
supine_force_law supine_patient_force(const supine_patient_power *power, double gain,
                                      const double gravity[3]);

#endif
