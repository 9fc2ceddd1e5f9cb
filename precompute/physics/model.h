/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Constants of the two laws, and the physical model of one basis or one solve. */
#ifndef SUPINE_MODEL_H
#define SUPINE_MODEL_H

#include "precompute/physics/equilibrium.h"
#include "precompute/physics/force.h"

/* clang-format off */
/** The laws, one per row: identifier, name, base, gain, (cx, cy, cz), (c1, ..., c6), bend, reach in
 * mm (0: over links, as in the paper), whether a single lung gets the heights of a pair, and a
 * description for the user.
 *
 * The paper's own constants (Table I) are lost: c1..c6 of `paper` are fits to the 4-D CT landmarks
 * of ten patients (DIR-Lab), those of `deep` to the full breaths of ten more (DIR-Lab COPDgene). In
 * the posture of those scans, supine, h = 1 - Y: base, cy and gain cannot be told apart there. The
 * gravity-dependent part of the force is 0.4, of a mean force of 1: at rest the lowest tissue lies
 * 1.5 times as far below its full size as the uppermost. Milic-Emili (J Appl Physiol 1966) showed
 * that lower regions are emptier; the figure itself is an assumption.
 *
 * The bend has one free number, 0.45, chosen on ten quiet breaths (DIR-Lab 4-D CT). With it one
 * scalar for each patient explains a median of 78 % (53 to 87) of the squared displacement; without
 * it, 47 %.
 *
 * A heart that presses on the lung below it was tried and left out: strong enough to raise the left
 * lung's share of a breath, lying on the left, from 48 to 49.5 % (58 published), it raises the
 * ratio of ventilation of the lowest to the uppermost quarter, prone, from 1.4 to 1.6, although it
 * should be nearer 1. */
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

/** The physical model of one basis or one solve: everything but the geometry. The caller owns the
 * arrays. */
typedef struct supine_model {
  supine_law law; /**< source of the constants */
  supine_force_law force;
  supine_direction_law direction;
  double bend[3];          /**< of the path from full inflation to rest, see supine_volume_bend */
  const double *stiffness; /**< [N] E, or NULL: 1 everywhere */
  const double *lesions;   /**< [N] factors on the normalised E (disease.h), or NULL: 1 */
  double reach;    /**< spreading length, mm, clamped to half the diagonal of the lungs' box;
                        0: the paper's transfer, over links */
  double share[2]; /**< each lung's share of its healthy volume and breath: 1 unless collapsed */
} supine_model;

/** Return the model of healthy lungs of uniform stiffness under a law. */
supine_model supine_physics_model(supine_law law);

/** Names of the laws, indexed by supine_law and ended by NULL. */
extern const char *const supine_physics_law_names[SUPINE_LAW_COUNT + 1];

/** Set up the equilibrium of lungs with the model's stiffness, lesions and reach.
 * @param lungs        must outlive the equilibrium
 * @param equilibrium  points to NULL, then to a new equilibrium that the caller destroys; or to
 *                     that of the same lungs, whose vertices may have moved since: then updated
 * @retval SUPINE_ERROR_ARGUMENT  softening without a reach: the paper's transfer depends on the
 * stiffness, so it would change with gravity
 * Other statuses as supine_physics_equilibrium_create and supine_physics_equilibrium_set_stiffness
 */
supine_status supine_physics_model_equilibrium(const supine_lungs *lungs, const supine_model *model,
                                               supine_equilibrium **equilibrium,
                                               supine_error *error);

#endif
