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

/** The physical model of one basis or one solve. */
typedef struct supine_model {
  supine_force_law force;
  supine_direction_law direction;
  const double *stiffness; /**< [N] E, or NULL: 1 everywhere */
} supine_model;

supine_model supine_physics_model_default(void);

#ifdef __cplusplus
}
#endif
#endif
