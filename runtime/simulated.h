/* SPDX-License-Identifier: MIT */
/** @file
 * Bases of another simulator's fields over gravity and volume. The weights of the modes are
 * functions of the direction of gravity g and of a parameter t of each lung, which the simulated
 * volumes mapped to -1 to 1:
 *
 *     w_k(g, t) = sum over lm, n of modes[k, lm, n] Y_lm(g) T_n(t)
 *
 * The surface holds nearly the volume that t stands for. Solve for the t at which it holds exactly
 * the volume that is asked. */
#ifndef SUPINE_RUNTIME_SIMULATED_H
#define SUPINE_RUNTIME_SIMULATED_H

#include "runtime/internal.h"

/** What a basis knows of the simulated volumes. Volumes are mL above the reference surface. */
typedef struct supine_simulated {
  size_t order;         /**< highest degree of T_n; 0 if the fields do not depend on volume */
  const double *range;  /**< [lungs, 2] volumes at t = -1 and t = 1 */
  const double *limits; /**< [lungs, 2, 9] lowest and highest volume for a direction of gravity, as
                             harmonics of bands 0 to 2 */
  /** [lungs, 9, share_count] volume of each lung as products of harmonics of bands 0 to 2 and
   * Chebyshev polynomials of the total volume, mapped to -1 to 1. */
  const double *shares;
  size_t share_count;
  double total[2]; /**< total volumes that are mapped to -1 and 1 */
} supine_simulated;

/** Compute the lowest and the highest simulated volume of each lung for a direction of gravity.
 * @param limits  [lungs, 2] mL above the reference surface, written
 * @retval SUPINE_ERROR_ARGUMENT  gravity is zero or not finite */
supine_status supine_simulated_limits(const supine_basis *basis, const double gravity[3],
                                      double (*limits)[2]);

/** Divide a total volume among the lungs as the simulator did.
 * @param total    mL above the reference surfaces
 * @param volumes  [lungs] mL above the reference surface of each lung, written; they add up to
 *   the total
 * @retval SUPINE_ERROR_ARGUMENT  gravity is zero or not finite
 * @retval SUPINE_ERROR_NUMERICAL  no lungs of that total were simulated for this direction; the
 *   message has the range */
supine_status supine_simulated_share(const supine_basis *basis, const double gravity[3],
                                     double total, double *volumes, supine_error *error);

/** Compute the weights of all lungs at which each holds its volume.
 * @param volumes  [lungs] mL above the reference surface
 * @param pose     its weights are written, by lung and mode
 * @retval SUPINE_ERROR_ARGUMENT   gravity is zero or not finite
 * @retval SUPINE_ERROR_NUMERICAL  a volume is outside what was simulated; the message has the range
 */
supine_status supine_simulated_solve(const supine_basis *basis, const double gravity[3],
                                     const double *volumes, supine_pose *pose, supine_error *error);

#endif
