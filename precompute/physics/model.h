/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * What the physics of one basis or one solve is made of. */
#ifndef SUPINE_MODEL_H
#define SUPINE_MODEL_H

#include "precompute/physics/equilibrium.h"
#include "precompute/physics/force.h"

/* clang-format off */
/** The laws, a row each: identifier, name, base, gain, (cx, cy, cz), (c1, ..., c6), bend, reach in
 * mm (0: over links, as the paper), whether a lung alone has its pair's heights, and what it is.
 *
 * The paper's own constants (Table I) are lost: c1..c6 of `paper` are fits to the 4-D CT landmarks
 * of ten patients (DIR-Lab), those of `deep` to the full breaths of ten more (DIR-Lab COPDgene). In
 * the posture of those scans, supine, h = 1 - Y: base, cy and gain cannot be told apart there. The
 * part of the gradient that turns with gravity is taken as 0.4 of a mean of 1: at rest the lowest
 * lung lies 1.5 times as far below its full size as the uppermost. That lower regions are the
 * emptier ones is Milic-Emili's (J Appl Physiol 1966); the figure itself is an assumption.
 *
 * The bend's one number was chosen on ten quiet breaths (DIR-Lab 4-D CT), of whose squared
 * displacement one scalar a patient then explains 78 % (53 to 87) at the median, 47 % without.
 *
 * A heart that presses on the lung below it was tried and left out: strong enough to raise the left
 * lung's part of a breath on the left from 48 to 49.5 % (58 published), it takes ventilation prone,
 * lowest over uppermost quarter, from 1.4 to 1.6, farther from even. */
#define SUPINE_LAWS(LAW)                                                                           \
  LAW(DEEP, "deep", 0.9, 0.4, (0, -0.2, 0), (6, 2.6, 15, 1, 16, 1.3), (0, -0.45, 0.45), 10, true,  \
      "postures and breaths between full inflation, rest and beyond (default)")                    \
  LAW(PAPER, "paper", 0, 1, (0, 0, 0), (2, 1.5, 1.5, 1, 16, 1.4), (0, 0, 0), 0, false,             \
      "Santhanam 2008 as published: breaths are added to the scan as it is (implies --scanned "    \
      "none)")
/* clang-format on */
typedef enum supine_law {
#define SUPINE_LAW_ENUM(id, ...) SUPINE_LAW_##id,
  SUPINE_LAWS(SUPINE_LAW_ENUM)
#undef SUPINE_LAW_ENUM
      SUPINE_LAW_COUNT
} supine_law;

/** The physical model of one basis or one solve: all that is not geometry. Arrays are the caller's.
 */
typedef struct supine_model {
  supine_law law; /**< that the constants were taken from */
  supine_force_law force;
  supine_direction_law direction;
  double bend[3];          /**< of the way from full inflation to rest, see supine_volume_bend */
  const double *stiffness; /**< [N] E, or NULL: 1 everywhere */
  const double *lesions;   /**< [N] factors on the normalised E (disease.h), or NULL: 1 */
  double reach;            /**< spreading length, mm, at most half the box's diagonal counts; 0: the
                                paper's, a fixed number of links */
  double share[2]; /**< of its healthy volume and breath that each lung has: 1 unless collapsed */
} supine_model;

/** The model of healthy lungs of even stiffness under a law. */
supine_model supine_physics_model(supine_law law);

/** The names of the laws; NULL ends them. */
extern const char *const supine_physics_law_names[SUPINE_LAW_COUNT + 1];

/** Checks that the law is one that can be solved.
 * @retval SUPINE_ERROR_ARGUMENT  softening without a reach: the paper's transfer holds the
 * stiffness, so that it would turn with gravity */
supine_status supine_physics_model_check(const supine_model *model, supine_error *error);

/** Set up the equilibrium of lungs with the model's stiffness, lesions and reach.
 * @param lungs        must outlive the equilibrium
 * @param equilibrium  NULL in, or that of the same lungs, whose vertices may have moved since
 * Statuses as supine_physics_equilibrium_create and supine_physics_equilibrium_set_stiffness */
supine_status supine_physics_model_equilibrium(const supine_lungs *lungs, const supine_model *model,
                                               supine_equilibrium **equilibrium,
                                               supine_error *error);

#endif
