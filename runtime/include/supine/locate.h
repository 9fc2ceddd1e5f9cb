/* SPDX-License-Identifier: MIT */
/** @file
 * Expected errors of predicted positions, and lungs found from a few observed points.
 *
 * The expected error sigma_i of vertex i is the 3-D RMS distance between its true and its predicted
 * position, after the translation that fits best. It is the root of a sum of terms:
 *
 *     sigma_i^2 = |u_i| c s                              displacement
 *               + |w_i| max(0, 4.5 mm s_0 - c s)         turn, after a fit in one posture
 *               + (|dx_i/dV| s_V)^2                      assumed volume
 *               + (12 mm |Dg_xy| b_i)^2                  heart
 *               + (3 mm |Dg_x|)^2                        sliding
 *               + |e (x_i - h)|^2                        collapse
 *
 * After a fit of landmarks, RMS of |u| q_i replaces |u_i| in the first term: q_i is the share of
 * the variance that kriging of a constant field leaves at the vertex, given the landmarks, divided
 * by its mean at landmarks that were held out (tensor "error_share", <supine/doubt.h> has the
 * kernel; the landmarks have a tenth of its variance as noise).
 *
 *     u_i     displacement of the vertex from a state whose positions are exact, mm
 *     c       4.5 mm (95 % interval 3.7 to 5.7), measured on full breaths of 15 people in one
 *             posture; or the constant of a patient's fit, metadata "expected_error_mm"
 *     s       min(1, RMS of |u| over the lungs / R). R is 18 mm, measured on quiet breaths of 10
 *             people; or the RMS displacement of a fit, metadata "expected_error_from_mm"
 *     s_0     s with R = 18 mm
 *     w_i     part of u_i that a change of posture adds, mm. The term is 0 after a fit to a scan
 *             in another posture too, metadata "turn_fitted"
 *     x_i     position of the vertex, mm
 *     V       volume of all lungs, mL
 *     s_V     0.17, or metadata "resting_spread", of the volume that was assumed: at rest, that is
 *             0.08 of full inflation. The error is common to all postures: two states at rest
 *             differ by |d(u_i)/dV| s_V
 *     Dg      change of the unit vector of gravity
 *     b_i     max(0, 1 - X / 0.7) 4 Y (1 - Y) max(0, 1 - |Z - 0.65| / 0.35), with X from the
 *             midline outwards, Y from the back and Z from the apex, 0 to 1 in the box around the
 *             lungs. The heart moves by up to 19 mm (Chino & Marks 2008, n 16), but not here
 *     e, h    of a collapsed lung with the share c of its volume: e = c^(-1/3) - 1, and its hilum.
 *             e (x_i - h) is the way from the place in the healthy lung, which is more than half
 *             the distance from the place that the law gives a lung of the same volume. Assumed: no
 *             collapse was measured. Between two states, the difference of these vectors counts
 *
 * For a change of posture, all terms are extrapolations: nobody was scanned in two postures. Half
 * of all points lie within 0.9 sigma of the truth, 95 % within 1.8 sigma.
 *
 * A position and a displacement have different errors. The error of a position counts from the
 * scan, whatever state its displacement is measured from.
 *
 * All these constants come from pairs of scans of one session. On another day, full inspirations of
 * the same people differ: sigma_other^2 = sigma^2 + (6.2 mm)^2 (supine_expected_another_day).
 *
 * Observed points correct the predicted positions by kriging, and the kriging variance replaces the
 * first three terms where it is smaller. If a rotation is fitted, or fewer than three points were
 * observed, it always replaces them. All errors are then multiplied by a factor that the points
 * decide (supine_locate). |u_i| and its RMS count as 2 mm at least.
 *
 * Stability: growing. A minor version may change functions and structs without a replacement;
 * CHANGELOG.md names the change. */
#ifndef SUPINE_LOCATE_H
#define SUPINE_LOCATE_H

#include <stdbool.h>
#include <stddef.h>

#include <supine/findings.h>
#include <supine/runtime.h>
#include <supine/state.h>

#ifdef __cplusplus
extern "C" {
#endif

/** Default of the factor c in the formula of the expected error (top of this file), mm. */
#define SUPINE_EXPECTED_ERROR_MM 4.5

/** RMS distance of two full inspirations of one person on different days, after a rigid motion and
 * at the same volume, mm: landmarks of nine people, perhaps a year apart (NLST). It was 4.7 to 9.4
 * mm, so that what is stated is 0.83 to 1.39 of the truth (tests/evidence/sessions.py). */
#define SUPINE_ANOTHER_DAY_MM 6.2

/** Return the expected error of a position on another day than that of the scan, mm, from that in
 * the session of the scan: sqrt(same_session^2 + SUPINE_ANOTHER_DAY_MM^2). */
SUPINE_API double supine_expected_another_day(double same_session);

/** Terms of the formula of the expected error (top of this file). */
typedef enum supine_expected_term {
  SUPINE_EXPECTED_DISPLACEMENT = 0,
  SUPINE_EXPECTED_TURN,
  SUPINE_EXPECTED_VOLUME,
  SUPINE_EXPECTED_HEART,
  SUPINE_EXPECTED_SLIDING,
  SUPINE_EXPECTED_COLLAPSE,
  SUPINE_EXPECTED_TERMS
} supine_expected_term;

/** Compute the expected error of every vertex in a state: of its position if `from` is NULL, or of
 * its displacement from the state `from`.
 *
 * In a basis of another simulator's fields, the error is that of the fit, and says nothing of how
 * well the simulator describes a person. It follows from runs that are left out: at a vertex, over
 * all directions of gravity, it is that of the tensor "error_vertices"; with gravity g it is
 * |E y(g)| times as large, where y has the harmonics of g to degree L + 1, and E is the tensor
 * "error_gravity" [2 L + 4, (L + 2)^2]. This is least near the directions of the runs and largest
 * in the gaps between them. The first row of E is constant. The squares of the others are
 * multiplied by a factor that depends on the total volume of the lungs: by linear interpolation
 * between those of the tensor "error_volume" [V], which are at evenly spaced volumes from the
 * smallest to the largest simulated; 1 without this tensor. The errors of two states are
 * independent.
 *
 * Full inflation was assumed if the file was scanned at rest, and the volume at rest if it was not;
 * neither was, if the file has metadata "resting_known". Cost: up to eight evaluations of every
 * vertex.
 * @param from   NULL for the state of the scan
 * @param sigma  [N] expected 3-D RMS errors, mm, written
 * @return a status of supine_basis_pose, for either state, or one of these:
 * @retval SUPINE_ERROR_UNSUPPORTED  the basis was made from another simulator's displacements, and
 *   lacks their errors, as points do that 'supine embed' adds */
SUPINE_API supine_status supine_expected_error(const supine_basis *basis, const supine_state *state,
                                               const supine_state *from, float *sigma,
                                               supine_error *error);

/** A term of the expected error. The strings live as long as the basis. */
typedef struct supine_expected_part {
  const char *name;   /**< such as "heart" */
  const char *source; /**< where the constants of the term come from */
  double rms;         /**< RMS of the term over all vertices, mm */
} supine_expected_part;

/** Compute the terms of supine_expected_error. The sum of the squares of their RMS is the mean of
 * sigma^2. A basis of another simulator's fields is SUPINE_ERROR_UNSUPPORTED; other parameters and
 * statuses: as supine_expected_error.
 * @param parts  [SUPINE_EXPECTED_TERMS] written */
SUPINE_API supine_status supine_expected_parts(const supine_basis *basis, const supine_state *state,
                                               const supine_state *from,
                                               supine_expected_part *parts, supine_error *error);

enum { SUPINE_LOCATE_POINTS_MAX = 300 };

/** Standard deviation of the translation of the observations' frame along what no view sees, mm, if
 * none is given: assumed. */
#define SUPINE_LOCATE_DEPTH_MM 20.0

/** One observation of a point, a vertex of a basis: its position, or a line on which it lies, as a
 * camera or an X-ray shows it. Several observations of one vertex are several views of it. The
 * frame of all observed positions may be translated from the frame of the basis and, if
 * supine_locate_task.rigid is true, rotated. */
typedef struct supine_observation {
  size_t vertex;      /**< index of the vertex in the basis supine_locate_task.inside */
  double position[3]; /**< observed position, or any other place than `from` on the line, mm */
  double noise; /**< standard deviation of `position` per axis, mm, above 0; give 2 if unknown. For
                   a line: on each axis across it, at the point */
  bool on_line; /**< whether the point lies on the line from `from` through `position` */
  double from[3]; /**< source of the line, as that of an X-ray, mm; ignored for a point */
} supine_observation;

/** The input of supine_locate. */
typedef struct supine_locate_task {
  const supine_basis *inside; /**< basis that has the observed points as vertices */
  size_t count; /**< number of observations, 1 to SUPINE_LOCATE_POINTS_MAX; of at least 3 vertices
                   if `rigid` */
  const supine_observation *observed; /**< [count] observed points */
  supine_state state; /**< posture and volume; SUPINE_VOLUME_DEFAULT if the volume is unknown */
  bool rigid;         /**< whether to find a rotation in addition to the translation */
  /** If all observations are lines from one source, or parallel: prior standard deviation, mm, of
   * the translation of the frame along them, about 0; 0 for SUPINE_LOCATE_DEPTH_MM. Points and a
   * second view replace it. */
  double depth;
} supine_locate_task;

/** Lungs that supine_locate found, in the `space` given to it. */
typedef struct supine_location supine_location;

/** What supine_locate found. New versions add members only at the end. */
typedef struct supine_location_info {
  supine_state state; /**< state of the task; the volume found replaces an unknown volume */
  double volume;      /**< volume of all lungs, gas and tissue, mL; 0 if the basis has no volumes */
  double volume_error;       /**< standard deviation of `volume`, mL; 0 if the volume was given */
  double volume_prior_error; /**< prior standard deviation of `volume`, mL; 0 if known */
  double rotation[9]; /**< rotation matrix R by rows: observed = R (predicted + correction) + t */
  double translation[3]; /**< translation t in observed = R (predicted + correction) + t, mm */
  double residual_rms;   /**< RMS distance of all points but outliers from their predictions, mm */
  double log_evidence;   /**< log likelihood, for comparing tasks that differ only in the posture */
  size_t outlier_count;  /**< number of points that were left out as outliers */
  double residual_expected; /**< expected RMS of the distances in `residual_rms`, mm */
  double turn;        /**< turn of the points' frame that would quarter the residuals, rad, where no
                         rotation was to be found; 0 if there is none */
  double depth_error; /**< standard deviation of the translation along one view, mm; 0 if several
                         views or points fix it */
  double stretch[3];  /**< width, depth and height of what the points show, in the frame of the
                         basis, as multiples of the predicted ones; 1 if fewer than ten points are
                         known in space */
  double stretch_error[3]; /**< standard errors of `stretch` */
} supine_location_info;

/** Comparison of an observed point with its prediction by all other points. */
typedef struct supine_locate_residual {
  double distance; /**< from the observed to the predicted position, mm; 0 if not predicted */
  double sigma;    /**< expected RMS of `distance`, mm */
  bool outlier;    /**< the point was left out because `distance` is too large */
} supine_locate_residual;

/** Return the number of doubles that supine_locate needs for `count` points. */
SUPINE_API size_t supine_locate_space(size_t count);

/** Find the volume of the lungs, the rigid motion to the frame of the observations, and a
 * correction of the predicted positions, from observed points.
 *
 * An unknown volume has a normal distribution before the points are observed. Its mean is the
 * volume at rest or, if the basis has none, the volume in the scan. Its standard deviation is 0.17
 * of the volume of the reference surface.
 *
 * A point is an outlier if its distance from the prediction by all other points exceeds 3 standard
 * deviations of this distance. Outliers are left out, the worst first, as long as at least four
 * fifths of the points remain.
 *
 * The expected errors are multiplied by sqrt((10 + sum of z^2) / (10 + n)). z are the distances of
 * the n points that are no outliers from their predictions by all other points, divided by the
 * expected distances. If the variance of the distances, without noise, exceeds 1.5 times the
 * expected one, as with a wrong volume, what is beyond is added to the variance of every position.
 * With three or four points, an outlier cannot be found.
 *
 * A rotation has a prior with standard deviation 3 degrees about each axis, unless the points are
 * turned by more than 30 degrees: then their frame is another one. Cost: about 0.2 ms for 20
 * points, 0.1 s for 300.
 *
 * Of a point on a line, only the distance across the line counts. One view shows nothing of how far
 * the lungs are: that is supine_locate_task.depth before, and all stated errors contain it.
 * Lines of two views cost five times as much.
 * @param residuals  [count], written
 * @param space      [supine_locate_space(count)]; keep it as long as `found` is used
 * @param found      written; after a failure, NULL or a location for supine_location_get_info alone
 * @return a status of supine_basis_pose, or one of these:
 * @retval SUPINE_ERROR_ARGUMENT   a count, vertex, position or noise is out of range, or a
 *                                 rotation is to be found from fewer than three points, or one of
 *                                 more than 30 degrees from points on one line
 * @retval SUPINE_ERROR_NUMERICAL  the points are at one place, or differ from their predictions by
 *                                 more than 40 mm (RMS), or the fit needs a volume that the lungs
 *                                 cannot hold or that is below a tenth of full inflation */
SUPINE_API supine_status supine_locate(const supine_locate_task *task,
                                       supine_locate_residual *residuals, double *space,
                                       const supine_location **found, supine_error *error);

/** Return what supine_locate found. The struct is in the `space` given to supine_locate. */
SUPINE_API const supine_location_info *supine_location_get_info(const supine_location *found);

/** Warn of what is doubtful in what supine_locate found: residuals that are much larger than
 * expected, a frame that is turned, or points that are of wider, deeper or higher lungs (checks
 * locate-residuals, locate-turned and locate-stretched). */
SUPINE_API void supine_location_check(const supine_location_info *found, supine_findings *findings);

/** Compute the positions of all vertices in the frame of the observations, and their expected
 * errors. Statuses: as supine_basis_pose. Cost: about 3 ms for 25,000 vertices and 20 points.
 * @param basis  basis of the located lungs, or of structures inside them
 * @param xyz    [N, 3] mm, written
 * @param sigma  [N] expected 3-D RMS errors, mm, written */
SUPINE_API supine_status supine_locate_positions(const supine_location *found,
                                                 const supine_basis *basis, float *xyz,
                                                 float *sigma, supine_error *error);

#ifdef __cplusplus
}
#endif
#endif
