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

/** Compute the lowest and the highest simulated volume of each lung for a direction of gravity.
 * @param limits  [lungs, 2] mL above the reference surface, written
 * @retval SUPINE_ERROR_ARGUMENT  gravity is zero or not finite */
supine_status supine_simulated_limits(const supine_basis *basis, const double gravity[3],
                                      double (*limits)[2]);

/** Compute the lowest and the highest simulated volume of all lungs together for a direction of
 * gravity, relative to the volume of a kind.
 * @param range  supine_volume.ml of the lowest and of the highest volume, mL, written
 * @retval SUPINE_ERROR_ARGUMENT  gravity is zero or not finite, or the file lacks this kind */
supine_status supine_simulated_range(const supine_basis *basis, const double gravity[3],
                                     supine_volume_kind kind, double range[2], supine_error *error);

/** Find what is added to the fitted volume of each lung so that the lungs hold their own volumes in
 * the scan, in its posture, where the fit gives nearly these (supine_simulated.offset).
 * @param offsets  [lungs] mL, written
 * @retval SUPINE_ERROR_ARGUMENT  the gravity in the scan is zero or not finite */
supine_status supine_simulated_find_offsets(const supine_basis *basis, double *offsets);

/** Find the volume of states without one: rest, if it is known; else that of the scan, if all lungs
 * can hold it in 26 directions of gravity; else, rounded to 1 mL, the middle of the total volumes
 * that were simulated in all of them. */
supine_status supine_simulated_find_default(const supine_basis *basis, supine_volume *volume);

/** Compute the weights of a state (supine_basis_pose) for a basis whose order is above 0. A state
 * without a volume has that of supine_basis_default_volume. A volume of all lungs is divided among
 * them as the simulator did.
 * @param pose  written: weights by lung and mode; gains of 1
 * @param state  gravity is neither zero nor infinite: supine_basis_pose_any checks it
 * @retval SUPINE_ERROR_ARGUMENT   the volume is relative to rest or
 *                                 full inflation, which the file lacks; or a lung is unknown
 * @retval SUPINE_ERROR_NUMERICAL  the volume is outside what was simulated; the message has the
 *                                 range */
supine_status supine_simulated_pose(const supine_basis *basis, const supine_state *state,
                                    supine_pose *pose, supine_error *error);

#endif
