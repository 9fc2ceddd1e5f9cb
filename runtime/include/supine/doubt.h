/* SPDX-License-Identifier: MIT */
/** @file
 * The expected error as a random field: the mean and the covariance of any set of points in one or
 * several states, what remains of their errors after a rigid registration, and random lungs drawn
 * from the field. What is asked of several points together, such as the error of a distance,
 * follows from the covariance; errors of neighbouring points are far from independent.
 *
 * The covariance of the errors of point i in state s and point j in state t is a 3 x 3 matrix,
 * mm^2:
 *
 *     cov(i s, j t) = 4/9 sigma_is sigma_jt C_st k_ij I          displacement and turn
 *                   + d_is d_jt' + h_is h_jt' + l_s l_t'         volume, heart, sliding
 *                   + c_is c_jt'                                 collapse
 *                   + 4/9 (6.2 mm)^2 k_ij I                      another day, if asked for
 *
 *     sigma   expected error of the terms displacement and turn (supine/locate.h), mm
 *     k_ij    r (1 + a) exp(-a), a = sqrt(3) |p_i - p_j| / 90 mm, p: positions in the scan
 *     r       1 in one lung, 1/3 between two
 *     C_st    correlation of two states, common to all points: (V_s + V_t - V_st) /
 *             (2 sqrt(V_s V_t)), V the mean sigma^2 of all vertices, V_st that from state s to t.
 *             Negative eigenvalues are set to 0, and the diagonal then to 1
 *     d       shift of the point by one standard deviation of an assumed volume, mm, which moves
 *             all points together
 *     c       way from the healthy to the collapsed lung, mm (supine/locate.h)
 *     h, l    12 mm b_i Dg_xy and 3 mm Dg_x, vectors across the body and along x
 *             (supine/locate.h)
 *
 * After a fit of landmarks, which the basis keeps, displacement has the covariance of simple
 * kriging instead, which is small near them (unit variance before, noise of a tenth of it, k_L and
 * K_LL the correlations with and among the landmarks, w the share of its variance that they leave
 * at points that were held out):
 *
 *     4/9 sigma^2 C_st (k_ij - k_iL (K_LL + 1/10)^-1 k_Lj) / w
 *
 * sigma^2: mean of the term displacement. Located lungs (supine_locate) have the covariance of the
 * kriging that found them, with the errors of translation, volume and rotation, times the factor of
 * the residuals; its trace is the square of the error that supine_locate_positions states.
 *
 * 4/9 is 4/3 over three axes: sigma was measured after the best translation had been taken out,
 * which leaves 3/4 of the variance. tests/FIGURES.md compares errors of distances and of
 * registrations, as stated and as landmarks of people with COPD show them. 6.2 mm: nine people, two
 * full inspirations on two days (NLST), a constant that no test here measures. The kernel is
 * Matern's of order 3/2 (Rasmussen & Williams 2006, equation 4.17).
 *
 * Stability: growing. A minor version may change functions and structs without a replacement;
 * CHANGELOG.md names the change. */
#ifndef SUPINE_DOUBT_H
#define SUPINE_DOUBT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <supine/locate.h>

#ifdef __cplusplus
extern "C" {
#endif

enum {
  SUPINE_DOUBT_STATES_MAX = 16,
  SUPINE_DOUBT_FIDUCIALS_LEAST = 3,
  SUPINE_DOUBT_FIDUCIALS_MAX = 300
};

/** The input of supine_doubt_prepare. */
typedef struct supine_doubt_task {
  const supine_basis *basis;
  size_t state_count;         /**< 1 to SUPINE_DOUBT_STATES_MAX */
  const supine_state *states; /**< [state_count] */
  const supine_state *from;   /**< state whose positions are exact; NULL for that of the scan */
  bool another_day;           /**< whether the lungs are those of another day than the scan */
  /** Located lungs, in place of `states`, which is then not read and counts as one; NULL for
   * states. Positions are in the frame of the observations. Keep it as long as the field is used.
   */
  const supine_location *location;
} supine_doubt_task;

/** The prepared field. It lies in the caller's memory, and may be used by any number of threads. */
typedef struct supine_doubt supine_doubt;

/** Return the number of doubles of work space that a field needs. */
SUPINE_API size_t supine_doubt_space(const supine_basis *basis, size_t state_count);

/** Prepare the field of a basis in its states. No other function allocates or needs more space.
 * Cost: n (n + 1) / 2 evaluations of the expected error for n states, and the factor of a matrix
 * of the landmarks.
 * @param space  [supine_doubt_space(task->basis, task->state_count)]; keep it as long as the field
 * is used
 * @param doubt  written; NULL after a failure
 * @return a status of supine_expected_error, or one of these:
 * @retval SUPINE_ERROR_ARGUMENT  the number of states is out of range, or located lungs are to have
 * several states, another state to count from, or another day */
SUPINE_API supine_status supine_doubt_prepare(const supine_doubt_task *task, double *space,
                                              const supine_doubt **doubt, supine_error *error);

/** A point of the field: a vertex of the basis in one of the states. */
typedef struct supine_doubt_point {
  size_t vertex, state;
} supine_doubt_point;

/** Compute the predicted positions of points, and the covariance of their errors.
 * @param mean        [count, 3] mm, written; NULL to leave it out
 * @param covariance  [3 count, 3 count] mm^2, rows and columns x, y, z of the first point, then of
 *                    the next one; symmetric and positive semidefinite, up to rounding; written
 * @retval SUPINE_ERROR_ARGUMENT  a vertex or a state is out of range */
SUPINE_API supine_status supine_doubt_covariance(const supine_doubt *doubt, size_t count,
                                                 const supine_doubt_point *points, double *mean,
                                                 double *covariance, supine_error *error);

/** A rigid registration at fiducials, in the space of the caller. */
typedef struct supine_doubt_frame supine_doubt_frame;

/** Return the number of doubles of work space that a registration at `count` fiducials needs. */
SUPINE_API size_t supine_doubt_frame_space(const supine_basis *basis, size_t count);

/** Register state 0 of a field at fiducials: find the rigid motion that moves their predicted
 * positions closest to their positions in the scan. After it, the error of a target t is
 *
 *     e_t - J_t J_f^+ e_f        J p = translation + rotation x (p - mean of the fiducials)
 *
 * with the errors e_f of the fiducials: to first order, what a navigation system has left that was
 * registered there (the target registration error).
 * @param vertices  [count] fiducials, vertices of the basis
 * @param space     [supine_doubt_frame_space(basis, count)]; keep it as long as `frame` is used
 * @retval SUPINE_ERROR_ARGUMENT  there are fewer than three or too many fiducials, a vertex is out
 * of range, or they lie too nearly on one line (their RMS distance from it is below 10 mm): the
 * rotation about it is then open
 * @retval SUPINE_ERROR_UNSUPPORTED  the lungs are located: they have the observations' frame */
SUPINE_API supine_status supine_doubt_frame_prepare(const supine_doubt *doubt, size_t count,
                                                    const size_t *vertices, double *space,
                                                    const supine_doubt_frame **frame,
                                                    supine_error *error);

/** Return the motion of a registration: x becomes rotation x + translation.
 * @param rotation     [9] by rows, written
 * @param translation  [3] mm, written */
SUPINE_API void supine_doubt_frame_motion(const supine_doubt_frame *frame, double *rotation,
                                          double *translation);

/** Compute the expected errors that remain after a registration.
 * @param sigma  [end - begin] 3-D RMS errors of the vertices begin <= i < end, mm, written */
SUPINE_API supine_status supine_doubt_frame_errors(const supine_doubt_frame *frame, size_t begin,
                                                   size_t end, float *sigma);

/** Draw random lungs: the predicted positions of all vertices in state `state`, plus an error drawn
 * from the field. Samples of equal seed and index are equal in all states of the field, as far as
 * the states' errors are. They pass near what was observed, as Matheron's rule conditions a random
 * field: what the observed points would predict of it is subtracted from it, and noise is drawn for
 * them. Cost: 64 sines and cosines for each vertex and state of the field. The
 * volumes are not exact, and some triangles are turned over: supine_doubt_mend_sample. Each
 * observed point costs one evaluation of the kernel more for each vertex.
 * @param xyz  [N, 3] mm, written
 * @retval SUPINE_ERROR_ARGUMENT  the state is out of range */
SUPINE_API supine_status supine_doubt_sample(const supine_doubt *doubt, size_t state, uint64_t seed,
                                             size_t index, float *xyz, supine_error *error);

/** What random lungs need to keep the volumes of a state, in the space of the caller. */
typedef struct supine_doubt_mend supine_doubt_mend;

/** Return the number of doubles of work space that supine_doubt_mend_prepare needs. */
SUPINE_API size_t supine_doubt_mend_space(const supine_basis *basis);

/** Prepare the mending of samples of one state of a field: find how the error of every vertex
 * covaries with the volumes. Cost: some hundred evaluations of the kernel for each vertex and lung.
 * @param space  [supine_doubt_mend_space(basis)]; keep it as long as `mend` is used
 * @param mend   written; NULL after a failure, and where there is nothing to mend: the basis has
 *               neither a closed surface of the lungs nor a grid in them, or their error is 0, as
 * in the state of the scan
 * @retval SUPINE_ERROR_ARGUMENT  the state is out of range */
SUPINE_API supine_status supine_doubt_mend_prepare(const supine_doubt *doubt, size_t state,
                                                   double *space, const supine_doubt_mend **mend,
                                                   supine_error *error);

/** Mend a sample of the state: condition it on the predicted volume of each lung, which it then has
 * within 0.01 mL, and give triangles that it turned over the mean error of their vertices. The
 * covariance of mended samples is C - C g (g' C g)^-1 g' C, with the covariance C of
 * supine_doubt_covariance and the change g of the volumes with the vertices. Cost: about ten
 * passes over the triangles. Any number of threads may use one `mend`; NULL leaves the sample as it
 * is.
 * @param xyz  [N, 3] mm, of supine_doubt_sample; changed
 * @retval SUPINE_ERROR_NUMERICAL  no such lungs were found */
SUPINE_API supine_status supine_doubt_mend_sample(const supine_doubt_mend *mend, float *xyz,
                                                  supine_error *error);

#ifdef __cplusplus
}
#endif
#endif
