/* SPDX-License-Identifier: MIT */
/** @file
 * Expected errors of positions, and the fit of lungs to a few observed points.
 *
 *     sigma_i^2 = |u_i| min(c, RMS of u over the lungs) + (|dx_i/dV| 0.05 V_full)^2
 *
 * is the 3-D variance of the error of vertex i after the best translation, where u is the
 * displacement from another state, V_full the volume of the reference surface, and c a constant,
 * 4.5 mm (95 % interval 3.7 to 5.7). Half of all points lie within 0.9 sigma of the truth, 95 %
 * within 1.8 sigma. c was measured on full breaths of 15 people in one posture; for a change of
 * posture it is an extrapolation. The second term applies only to a state whose volume counts from
 * an assumed volume at rest.
 *
 * With observed points, kriging corrects the positions. Expected errors shrink near the points.
 * With three points or more and no unknown rotation, they never exceed those above; fewer points do
 * not determine the translation well enough. */
#ifndef SUPINE_LOCATE_H
#define SUPINE_LOCATE_H

#include <stdbool.h>
#include <stddef.h>

#include <supine/runtime.h>
#include <supine/state.h>

#ifdef __cplusplus
extern "C" {
#endif

/** The constant c of files without metadata "expected_error_mm", mm. */
#define SUPINE_EXPECTED_ERROR_MM 4.5

/** Compute the expected error of every vertex in a state, if the positions in state `from` are
 * exact.
 *
 * The file's metadata "expected_error_mm" replaces c. The volume at rest counts as known if the
 * file has metadata "resting_known" or was scanned at rest.
 * @param from   NULL: the scan
 * @param sigma  [N] mm, written
 * @retval SUPINE_ERROR_UNSUPPORTED  the basis was made from another simulator's fields, whose error
 *                                   is not known
 * @retval those of supine_basis_pose
 * Cost: four evaluations of every vertex; six if the volume at rest is assumed. */
SUPINE_API supine_status supine_expected_error(const supine_basis *basis, const supine_state *state,
                                               const supine_state *from, float *sigma,
                                               supine_error *error);

/** Largest number of observed points. */
enum { SUPINE_LOCATE_POINTS_MAX = 300 };

/** One observed point: a vertex of a basis, usually one that 'supine embed' made. */
typedef struct supine_observation {
  size_t vertex;
  double position[3]; /**< mm; the frame may be translated from that of the basis and, in a rigid
                           task, rotated */
  double noise;       /**< standard deviation per axis, mm, above 0; use 2 if it is unknown */
} supine_observation;

typedef struct supine_locate_task {
  const supine_basis *inside;         /**< basis whose vertices were observed */
  size_t count;                       /**< 1 to SUPINE_LOCATE_POINTS_MAX; 3 or more if rigid */
  const supine_observation *observed; /**< [count] */
  supine_state state; /**< posture and volume; a volume of kind DEFAULT is unknown: find it */
  bool rigid;         /**< find a rotation as well as the translation */
} supine_locate_task;

/** The result of supine_locate. */
typedef struct supine_location {
  supine_state state;        /**< the task's; if the volume was unknown, the one found, absolute */
  double volume;             /**< volume of all lungs, gas and tissue, mL; 0 without volumes */
  double volume_error;       /**< standard deviation of `volume`, mL; 0 if the volume was given */
  double volume_prior_error; /**< standard deviation of `volume` without observations, mL; 0 if the
                                  volume was given */
  double rotation[9];        /**< by rows: observed = rotation (body + correction) + translation */
  double translation[3];     /**< mm */
  double residual_rms;  /**< RMS distance of each point from its prediction by all other points, mm,
                             without outliers; 0 with one point */
  double log_evidence;  /**< log likelihood, to compare tasks that differ only in the posture */
  size_t outlier_count; /**< number of observations that do not fit and were left out */
  const void *fit;      /**< the fit, in the `space` that was given to supine_locate */
} supine_location;

/** Residual of an observed point. */
typedef struct supine_locate_residual {
  double distance; /**< distance of the observed position from its prediction by all other points,
                        mm; 0 if they do not determine it */
  double sigma;    /**< expected 3-D standard deviation of `distance`, mm */
  bool outlier;    /**< the observation does not fit and was left out */
} supine_locate_residual;

/** Return the number of doubles that supine_locate needs for `count` points. */
SUPINE_API size_t supine_locate_space(size_t count);

/** Find the state, the rigid motion and the correction from observed points.
 *
 * The prior of an unknown volume has its mean at rest (at the scan if the basis has no rest) and a
 * standard deviation of 0.17 of the reference volume. A point farther than 3 sigma from its
 * prediction by all other points is left out, the worst first, as long as at least four fifths of
 * the points remain.
 * @param residuals  [count], written
 * @param space      [supine_locate_space(count)]; keep it as long as `found` is used
 * @retval SUPINE_ERROR_ARGUMENT   a count, vertex, position or noise is out of range; for a
 *                                 rotation, fewer than three points, or points on one line
 * @retval SUPINE_ERROR_NUMERICAL  the fit leaves the volumes that the lungs can reach
 * @retval those of supine_basis_pose
 * Cost: about 0.2 ms for 20 points, 0.1 s for 300. */
SUPINE_API supine_status supine_locate(const supine_locate_task *task,
                                       supine_locate_residual *residuals, double *space,
                                       supine_location *found, supine_error *error);

/** Compute the positions of every vertex in the frame of the observations, and their expected
 * errors.
 * @param basis  basis of the located lungs, or of structures inside them
 * @param xyz    [N, 3] mm, written
 * @param sigma  [N] expected errors, mm, written
 * @retval those of supine_basis_pose
 * Cost: about 3 ms for 25,000 vertices and 20 points. */
SUPINE_API supine_status supine_locate_positions(const supine_location *found,
                                                 const supine_basis *basis, float *xyz,
                                                 float *sigma, supine_error *error);

#ifdef __cplusplus
}
#endif
#endif
