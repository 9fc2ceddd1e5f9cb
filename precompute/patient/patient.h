/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * A patient's own law of displacement, from that person's scans and landmarks ([Santhanam2008]
 * IV-B), and how well it held out.
 *
 * With X, Y, Z the box coordinates of lungs.h, side +1 left and -1 right, and u the displacement
 * from rest to the state that was fitted:
 *
 *     paper       u = (1 + c7 (X-1/2) + c8 (Y-1/2) + c9 (Z-1/2)) (side c1 X^c2, -c3 Y^c4, -c5 Z^c6)
 *     affine      u = polynomial of degree 1 in the position
 *     quadratic   u = polynomial of degree 2 in X, Y, Z; mirrored between the lungs, and what each
 *                 lung has beyond that, both held down as far as held-out blocks ask for
 *
 * The force is scaled to 1 at the box's centre, as only its product with the directions shows. */
#ifndef SUPINE_PATIENT_H
#define SUPINE_PATIENT_H

#include <stdbool.h>
#include <stddef.h>

#include "precompute/patient/pairs.h"

typedef enum supine_patient_law {
  SUPINE_PATIENT_PAPER = 0,
  SUPINE_PATIENT_AFFINE,
  SUPINE_PATIENT_QUADRATIC,
  SUPINE_PATIENT_LAW_COUNT
} supine_patient_law;

/** "paper", "affine", "quadratic". */
extern const char *const supine_patient_law_names[SUPINE_PATIENT_LAW_COUNT + 1];

/** Where box coordinates are counted from, mm. */
typedef struct supine_patient_frame {
  double minimum[3], maximum[3];
  double midline;
  int only_side; /**< +1 left or -1 right where one lung alone is there; else 0 */
} supine_patient_frame;

enum {
  SUPINE_PATIENT_TERMS = 10,     /**< of a polynomial of degree 2 in three variables */
  SUPINE_PATIENT_POWERS = 6,     /**< c2, c4, c6, c7, c8, c9: not linear in the displacement */
  SUPINE_PATIENT_POLYNOMIAL = 60 /**< three components, shared and by lung */
};

/** Held-out and fitted errors, mm RMS, of the law and of what it is to be better than. */
typedef struct supine_patient_scores {
  double none, translation, affine, affine_lungs;
  double law[SUPINE_PATIENT_LAW_COUNT];
} supine_patient_scores;

/** How far apart six starts ended. */
enum { SUPINE_PATIENT_STARTS = 6 };

typedef struct supine_patient {
  supine_patient_law law;
  supine_patient_frame frame;
  double powers[SUPINE_PATIENT_POWERS]; /**< c2, c4, c6, c7, c8, c9 */
  double lengths[3];                    /**< c1, c3, c5, mm */
  /** Coefficients by component, term and (shared, by lung), mm; motion included. */
  double polynomial[SUPINE_PATIENT_POLYNOMIAL];
  double motion[6]; /**< between the scans: translation (mm), small rotation (rad) about the box's
                       centre; u + motion is what was measured */
} supine_patient;

/** A place as the laws see it. */
typedef struct supine_patient_place {
  double box[3]; /**< X, Y, Z; 0 to 1 inside */
  double side;   /**< +1 left, -1 right */
  double arm[3]; /**< from the box's centre, mm */
} supine_patient_place;

supine_patient_place supine_patient_find(const supine_patient_frame *frame, const double point[3]);

/** The frame of points alone: their box, and 10 mm more on every side, as lungs end beyond their
 * landmarks.
 * @param midline  mm, or NULL: the box's centre */
supine_patient_frame supine_patient_frame_of_points(size_t count, const double *points,
                                                    const double *midline);

/** u at a point, mm, without the motion between the scans. Outside the frame: the paper's law as at
 * its nearest face, polynomials in a straight line from there. */
void supine_patient_displacement(const supine_patient *patient, const double point[3], double u[3]);

/** (15)-(17) of the paper's law at a point, without the force, mm. */
void supine_patient_paper_direction(const supine_patient *patient, const double point[3],
                                    double d[3]);

/** The motion between the scans at a point, mm. */
void supine_patient_motion(const supine_patient *patient, const double point[3], double u[3]);

/** The terms of a polynomial of degree 2 at a place, and, optionally, their derivatives along the
 * box's axes. */
void supine_patient_terms(const double box[3], double terms[SUPINE_PATIENT_TERMS],
                          double (*slopes)[SUPINE_PATIENT_TERMS]);

#endif
