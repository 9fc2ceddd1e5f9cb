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
 * With observed points, kriging corrects the positions, and expected errors shrink near the points.
 * With three points or more and no fitted rotation, expected errors never exceed the sigma that
 * results if |u| and its RMS are at least 2 mm and, for an unknown volume, 0.17 V_full replaces
 * 0.05 V_full. Fewer points do not determine the translation well enough. */
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
 * @param from   NULL for the state of the scan
 * @param sigma  [N] mm, written
 * @retval SUPINE_ERROR_UNSUPPORTED  the basis was made from another simulator's fields, whose error
 *                                   is not known
 * Other statuses: as supine_basis_pose. Cost: four evaluations of every vertex; six if the volume
 * at rest is assumed. */
SUPINE_API supine_status supine_expected_error(const supine_basis *basis, const supine_state *state,
                                               const supine_state *from, float *sigma,
                                               supine_error *error);

/** Largest number of observed points. */
enum { SUPINE_LOCATE_POINTS_MAX = 300 };

/** One observed point: a vertex of a basis, usually one that 'supine embed' made. */
typedef struct supine_observation {
  size_t vertex;      /**< index in the basis supine_locate_task.inside */
  double position[3]; /**< observed position, mm, in a frame that may be translated from the frame
                         of the basis and, in a rigid task, rotated */
  double noise;       /**< standard deviation on each axis, mm, above 0; if unknown, give 2 */
} supine_observation;

/** The input of supine_locate. */
typedef struct supine_locate_task {
  const supine_basis *inside; /**< basis whose vertices were observed */
  size_t count;               /**< 1 to SUPINE_LOCATE_POINTS_MAX points; at least 3 if `rigid` */
  const supine_observation *observed; /**< [count] observed points */
  supine_state state; /**< posture and volume; SUPINE_VOLUME_DEFAULT: find the volume */
  bool rigid;         /**< find a rotation as well as the translation */
} supine_locate_task;

/** The result of supine_locate. */
typedef struct supine_location {
  supine_state state; /**< state of the task, with an unknown volume replaced by the volume found */
  double volume;      /**< volume of all lungs, gas and tissue, mL; 0 if the basis has no volumes */
  double volume_error;       /**< standard deviation of `volume`, mL; 0 if the volume was given */
  double volume_prior_error; /**< standard deviation of `volume` without observations, mL; 0 if the
                                  volume was given */
  double rotation[9]; /**< [3, 3] by rows: observed = rotation (body + correction) + translation */
  double translation[3]; /**< translation in the equation of `rotation`, mm */
  double residual_rms;   /**< RMS distance of the points from their predictions by all other points,
                            mm, without outliers; 0 for one point */
  double log_evidence;   /**< log likelihood, to compare tasks that differ only in the posture */
  size_t outlier_count;  /**< number of observations that were left out because they do not fit */
  const void *fit;       /**< the fit, stored in the `space` that supine_locate was given */
} supine_location;

/** The comparison of an observed point with its prediction by all other points. */
typedef struct supine_locate_residual {
  double distance; /**< distance of the observed from the predicted position, mm; 0 if the other
                      points do not determine the prediction */
  double sigma;    /**< expected 3-D standard deviation of `distance`, mm */
  bool outlier;    /**< the observation was left out because it does not fit */
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
 * @param found      written
 * @retval SUPINE_ERROR_ARGUMENT   a count, vertex, position or noise is out of range; for a
 *                                 rotation, fewer than three points, or points on one line
 * @retval SUPINE_ERROR_NUMERICAL  the fit needs a volume that the lungs cannot reach
 * Other statuses: as supine_basis_pose. Cost: about 0.2 ms for 20 points, 0.1 s for 300. */
SUPINE_API supine_status supine_locate(const supine_locate_task *task,
                                       supine_locate_residual *residuals, double *space,
                                       supine_location *found, supine_error *error);

/** Compute the positions of every vertex in the frame of the observations, and their expected
 * errors. Statuses: as supine_basis_pose.
 * @param basis  basis of the located lungs, or of structures inside them
 * @param xyz    [N, 3] mm, written
 * @param sigma  [N] expected errors, mm, written
 * Cost: about 3 ms for 25,000 vertices and 20 points. */
SUPINE_API supine_status supine_locate_positions(const supine_location *found,
                                                 const supine_basis *basis, float *xyz,
                                                 float *sigma, supine_error *error);

#ifdef __cplusplus
}
#endif
#endif
