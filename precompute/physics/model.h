/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * What the physics of one basis or one solve is made of. */
#ifndef SUPINE_MODEL_H
#define SUPINE_MODEL_H

#include "precompute/physics/equilibrium.h"
#include "precompute/physics/force.h"

#ifdef __cplusplus
extern "C" {
#endif

/** The physical model of one basis or one solve: all that is not geometry. Arrays are the caller's.
 */
typedef struct supine_model {
  supine_force_law force;
  supine_direction_law direction;
  const double *stiffness; /**< [N] E, or NULL: 1 everywhere */
  const double *lesions;   /**< [N] factors on the normalised E (disease.h), or NULL: 1 */
  double reach;            /**< spreading length, mm; 0: the paper's, a fixed number of links */
  double tolerance;        /**< relative residual of every solve; 0: SUPINE_SOLVE_TOLERANCE
                              (equilibrium.h),        where directions are sampled 1e-6 */
  double share[2]; /**< of its healthy volume and breath that each lung has: 1 unless collapsed */
} supine_model;

supine_model supine_physics_model_default(void);

/** The network of lungs with the model's lesions and reach: what solves are set up with.
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_physics_model_network(const supine_lungs *lungs, const supine_model *model,
                                           supine_network **network);

#ifdef __cplusplus
}
#endif
#endif
