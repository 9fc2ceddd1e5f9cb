/* SPDX-License-Identifier: MIT */
/** @file
 * How far off positions are expected to be, and lungs found from a few observed points.
 *
 *     sigma_i^2 = |u_i| min(c, RMS of u over the lungs) + (|dx_i/dV| 0.05 V_full)^2
 *
 * is the 3-D variance of vertex i after a free translation, u its displacement from a reference
 * state. Half of all points lie within 0.9 sigma, 95 % within 1.8. c is 4.5 mm (95 % interval 3.7
 * to 5.7), from full breaths of 15 people in one posture; for turns it is an extrapolation. The
 * second term is there where the resting volume is assumed and not known.
 *
 * With observed points the law's positions are corrected by kriging. Expected errors shrink near
 * the points and, from three points on, never exceed those above; fewer say too little of the
 * translation. */
#ifndef SUPINE_LOCATE_H
#define SUPINE_LOCATE_H

#include <stdbool.h>
#include <stddef.h>

#include <supine/runtime.h>
#include <supine/state.h>

#ifdef __cplusplus
extern "C" {
#endif

/** c of files that do not say theirs, mm. */
#define SUPINE_EXPECTED_ERROR_MM 4.5

/** Compute the expected error of every vertex in a state, counted from another.
 *
 * A file's metadata "expected_error_mm" replaces c; "resting_known" says that rest is no guess, as
 * does a scan at rest.
 * @param from   NULL: the scan
 * @param sigma  [N] mm, written
 * @retval SUPINE_ERROR_UNSUPPORTED  the basis was made from another simulator's fields, whose error
 *                                   is not known
 * @retval those of supine_basis_pose
 * Cost: two to four evaluations of every vertex. */
SUPINE_API supine_status supine_expected_error(const supine_basis *basis, const supine_state *state,
                                               const supine_state *from, float *sigma,
                                               supine_error *error);

enum { SUPINE_LOCATE_POINTS_MAX = 300 };

/** One observed point of a basis, usually one of 'supine embed'. */
typedef struct supine_observation {
  size_t vertex;
  double position[3]; /**< mm, in any frame that the lungs' axes are shifted to, or turned where the
                           task is rigid */
  double noise;       /**< standard deviation per axis, mm, above 0; 2 where nothing is known */
} supine_observation;

typedef struct supine_locate_task {
  const supine_basis *inside; /**< the observed points are vertices of it */
  size_t count;               /**< 1 to SUPINE_LOCATE_POINTS_MAX; 3 where rigid */
  const supine_observation *observed;
  supine_state state; /**< volume of kind DEFAULT: to be found */
  bool rigid;         /**< a rotation is to be found beside the translation */
} supine_locate_task;

/** What was found. */
typedef struct supine_location {
  supine_state state;        /**< its volume is absolute where it was found */
  double volume;             /**< mL of all lungs, gas and tissue */
  double volume_error;       /**< its standard deviation; 0 where the volume was given */
  double volume_prior_error; /**< the same before any point was observed */
  double rotation[9];        /**< by rows: observed = rotation (body + correction) + translation */
  double translation[3];     /**< mm */
  double residual_rms;  /**< of the observed points from all others' prediction, mm; 0 of one */
  double log_evidence;  /**< of the posture, for comparing tasks that differ in it alone */
  size_t outlier_count; /**< observations that do not fit and were left out */
  const void *fit;      /**< in the workspace */
} supine_location;

/** How an observed point fits. */
typedef struct supine_locate_residual {
  double distance; /**< from where all other points put it, mm; 0 where nothing does */
  double sigma;    /**< its standard deviation, 3-D, mm */
  bool outlier;    /**< does not fit: left out */
} supine_locate_residual;

/** How many doubles supine_locate needs for `count` points. */
SUPINE_API size_t supine_locate_space(size_t count);

/** Find the state, the motion and the correction from observed points.
 *
 * An unknown volume has the prior of rest (of the scan where no rest is known) with a standard
 * deviation of 0.17 of the reference volume. A point farther than 3 sigma from where the others
 * put it is left out, the worst first, while four fifths of the points remain.
 * @param residuals  [count], written
 * @param space      [supine_locate_space(count)], kept by `found`
 * @retval SUPINE_ERROR_ARGUMENT   a count, vertex, position or noise out of range; a rotation of
 *                                 fewer than three points, or of points on one line
 * @retval SUPINE_ERROR_NUMERICAL  no volume fits
 * @retval those of supine_basis_pose
 * Cost: about 0.2 ms of 20 points, 0.1 s of 300. */
SUPINE_API supine_status supine_locate(const supine_locate_task *task,
                                       supine_locate_residual *residuals, double *space,
                                       supine_location *found, supine_error *error);

/** Positions of every vertex of a basis of the same lungs, in the observations' frame.
 * @param xyz    [N, 3] mm, written
 * @param sigma  [N] expected errors, mm, written
 * @retval those of supine_basis_pose
 * Cost: about 3 ms of 25,000 vertices and 20 points. */
SUPINE_API supine_status supine_locate_positions(const supine_location *found,
                                                 const supine_basis *basis, float *xyz,
                                                 float *sigma, supine_error *error);

#ifdef __cplusplus
}
#endif
#endif
