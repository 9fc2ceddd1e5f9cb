/* SPDX-License-Identifier: MIT */
/** @file
 * Expected errors of predicted positions: the terms of the formula in supine/locate.h. */
#ifndef SUPINE_EXPECTED_H
#define SUPINE_EXPECTED_H

#include <supine/locate.h>

#include "runtime/kriging.h"

enum { LOCATE_BLOCK = 64 }; /**< number of vertices evaluated at once */

/* Relative standard deviation of an assumed volume, that at rest if full inflation was scanned and
 * full inflation if rest was scanned, unless metadata "resting_spread" gives it: 0.08 / 0.48, the
 * published share at rest and its spread between people (precompute/physics/resting.h). */
#define EXPECTED_SPREAD 0.17
/* RMS displacement of a full breath, mm, below which c falls in proportion: 4.5 mm / 0.25, where
 * 0.25 was measured on the quiet breaths of ten people (4-D CTs). Nobody was held out; what is then
 * stated is 0.66 to 1.32 of the true error. */
#define EXPECTED_FULL_BREATH 18.0
/* Error beside the heart for a change of gravity of 1 across the body, and the error along gravity
 * for a change of 1 sideways, mm. The former is chosen so that from supine to prone (a change of 2)
 * the RMS beside the heart is about that of its motion (up to 19 mm; Chino & Marks 2008, n 16); the
 * latter is assumed. Landmarks have not checked them: nobody was scanned in two postures. */
#define EXPECTED_HEART 12.0
#define EXPECTED_SLIDING 3.0

/** Return the constant c of the formula of the expected error (supine/locate.h), mm. It is the
 * metadata "expected_error_mm" of the file or, if the file lacks it, SUPINE_EXPECTED_ERROR_MM. */
double supine_expected_constant(const supine_basis *basis);

/** Return how many landmarks of a patient's fit the file has; 0 if it was not made from one. */
size_t supine_expected_landmark_count(const supine_basis *basis);

/** Return the mean share of the error's variance that the landmarks leave at points that were held
 * out of the fit: the unit of the tensor "error_share". */
double supine_expected_held_out(const supine_basis *basis);

/** Fit the random field of the error to the landmarks (supine_kriging_fit_landmarks).
 * @param seen   [landmarks] written; keep them as long as the fit is used
 * @param space  [supine_kriging_space(landmarks)]; keep it as long as the fit is used */
supine_status supine_expected_fit_landmarks(const supine_basis *basis, supine_kriging_point *seen,
                                            double *space, supine_kriging *fit,
                                            supine_error *error);

/** Return the error of a fit to another simulator's fields in a direction of gravity, divided by
 * its RMS over all directions: |E y|.
 * @param band       L, that of the fit, at most FIT_BAND_MAX
 * @param harmonics  E [2 L + 4, (L + 2)^2], or NULL if it is unknown: the result is 1
 * @param factor     of the squares of all rows of E but the first, whose harmonic is constant; 1 in
 *   the mean over the runs */
double supine_expected_along(size_t band, const double *harmonics, const double gravity[3],
                             double factor);

/** Limits of the 95 % interval of SUPINE_EXPECTED_ERROR_MM, mm. */
#define EXPECTED_ERROR_LOW 3.7
#define EXPECTED_ERROR_HIGH 5.7

/** Return the kind of volume that was assumed instead of measured: rest, full inflation, or DEFAULT
 * for none. */
supine_volume_kind supine_expected_assumed(const supine_basis *basis);

/** Return the sum of the volumes of all lungs of the reference surface, mL. */
double supine_expected_reference(const supine_basis *basis);

/** Fraction of the reference volume that supine_expected_shifted adds to the lungs: 0.01. */
extern const double supine_expected_shift;

/** Compute the pose of a state whose volume is increased by 1 % of the volume of the reference
 * surface. If the state gives a volume for each lung, each lung gets an equal part of the
 * increase. Statuses: as supine_basis_pose. */
supine_status supine_expected_shifted(const supine_basis *basis, const supine_state *state,
                                      supine_pose *pose, supine_error *error);

/** Poses of the state whose errors are computed, and of the state whose positions are exact: as
 * given; with 1 % of the reference volume added, if their volume is uncertain; and with the gravity
 * of the scan, if a fit has not seen their posture. */
enum {
  EXPECTED_AT,
  EXPECTED_FROM,
  EXPECTED_FULLER,
  EXPECTED_FULLER_FROM,
  EXPECTED_LEVEL,
  EXPECTED_LEVEL_FROM,
  EXPECTED_POSES
};

/** A place of the body to which errors are relative, such as the hilum of a lung. */
typedef struct supine_expected_anchor {
  double position[3];              /**< on the reference surface, mm */
  double u[EXPECTED_POSES / 2][3]; /**< displacement by each pair of poses, mm */
  double beside_heart;             /**< the number b of the formula */
} supine_expected_anchor;

/** All numbers of the formula that are the same for all vertices. */
typedef struct supine_expected_model {
  const supine_basis *basis;
  supine_pose pose[EXPECTED_POSES];
  double least;    /**< shorter displacements count as displacements of this length, mm */
  double law;      /**< squared error per mm of displacement, mm */
  double turn;     /**< additional squared error per mm of displacement by a turn, mm */
  double per_step; /**< standard deviation of the volume / volume added in EXPECTED_FULLER */
  double rms;      /**< RMS displacement of the lungs, mm */
  double across;   /**< length of the change of unit gravity in the x-y plane */
  double sideways; /**< length of the change of unit gravity along x */
  /** Of each lung, in EXPECTED_AT and EXPECTED_FROM: e of the formula, 0 if it is not collapsed,
   * and the position of its hilum, mm. */
  double collapse[SUPINE_LUNGS_MAX][2], hilum[SUPINE_LUNGS_MAX][2][3];
  /** If not 0, the squared errors are those of the displacement minus the mean displacement of the
   * anchors, of which each lung has one. */
  size_t anchor_count;
  supine_expected_anchor anchor[SUPINE_LUNGS_MAX];
} supine_expected_model;

/** Displacements of vertices in each pose of a model, and their squared errors by term, mm^2. */
typedef struct supine_expected_block {
  float x[EXPECTED_POSES][3 * LOCATE_BLOCK];
  double square[LOCATE_BLOCK][SUPINE_EXPECTED_TERMS];
  double collapse[LOCATE_BLOCK][3]; /**< vector of the term of collapse, mm */
} supine_expected_block;

/** Prepare the formula for the displacement from state `from` to `state`.
 * @param deviation  standard deviation of the volume of `state`, mL, which then replaces that of an
 *                   assumed volume; 0 to use the latter
 * @param least      supine_expected_model.least
 * @return as supine_basis_pose */
supine_status supine_expected_prepare(const supine_basis *basis, const supine_state *state,
                                      const supine_state *from, double deviation, double least,
                                      supine_expected_model *model, supine_error *error);

/** Compute the squared errors of a displacement by term, mm^2. That of a collapse is 0, as at the
 * hilum.
 * @param u             displacement between the two states, mm, by each pair of poses of the model
 * @param beside_heart  the number b of the formula */
void supine_expected_squares(const supine_expected_model *model, double u[EXPECTED_POSES / 2][3],
                             double beside_heart, double square[SUPINE_EXPECTED_TERMS]);

/** Add an anchor in the middle of the hilum of each lung, at the box coordinates 0.175, 0.5 and
 * 0.5. The error of a displacement relative to the hila, u_i - u_h with u_h the mean of theirs, has
 * the terms
 *
 *     displacement, turn  V_i + V_h - 2 C_ih, with the covariance of kriging (kriging.h) and the
 *                         sill 4/3 c s: taking out the best translation leaves 3/4 of the variance
 *     volume              |d(u_i - u_h)/dV| s_V
 *     heart               12 mm |Dg_xy| (b_i - b_h), as the heart moves the hilum too
 *     sliding, collapse   as in the body
 *
 * @param mean  [lungs, 3, modes] displacement of each hilum by each mode at weight and gain 1, mm
 */
void supine_expected_relate(supine_expected_model *model, const double *mean);

/** Return the squared error, mm^2, by which another day adds to that of a vertex's position: that
 * of SUPINE_ANOTHER_DAY_MM or, with anchors, that of the difference from their mean. */
double supine_expected_day_square(const supine_expected_model *model, size_t vertex);

/** Write the expected error of every vertex to `sigma`, if it is not NULL, and the mean squared
 * error of each term to `mean`. */
void supine_expected_all(const supine_expected_model *model, float *sigma,
                         double mean[SUPINE_EXPECTED_TERMS]);

/** Evaluate vertices begin <= i < end, at most LOCATE_BLOCK. */
void supine_expected_evaluate(const supine_expected_model *model, size_t begin, size_t end,
                              supine_expected_block *block);

#endif
