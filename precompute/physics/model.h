/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Constants of the two displacement laws, and the physical model of a basis or of one solve. */
#ifndef SUPINE_MODEL_H
#define SUPINE_MODEL_H

#include "precompute/physics/equilibrium.h"
#include "precompute/physics/force.h"

/* clang-format off */
/** The displacement laws: identifier, name, base, gain, (cx, cy, cz), (c1, ..., c6), bend, reach in
 * mm (0 for the paper's transfer of force), pair (supine_force_law), description for the user.
 *
 * The paper's constants (Table I) are not available: c1..c6 of `paper` are fits to 4-D CT landmarks
 * of ten patients (DIR-Lab), c1..c6 of `deep` to the full breaths of ten others (DIR-Lab COPDgene).
 * These scans are supine, where h = 1 - Y (force.h), so base, cy and gain cannot be determined
 * separately. The gain of `deep` is an assumption: with cy Y at its mean, the force is 0.8 on the
 * uppermost tissue and 1.2 on the lowest, a ratio of 1.5. That lower tissue moves more agrees with
 * Milic-Emili (J Appl Physiol 1966), who found lower regions emptier.
 *
 * The bend has one free number, 0.45, chosen on ten quiet breaths (DIR-Lab 4-D CT). With the
 * bend, one gain for each patient explains 78 % of the squared displacement (median; 53 to 87 %),
 * without it 47 %.
 *
 * The weight of the heart on the lung below it is left out. If it raised the left lung's share
 * of a breath, lying on the left, from 48 to 49.5 % (published: 58), the ratio of ventilation of
 * the lowest to that of the uppermost quarter, prone, would rise from 1.4 to 1.6 (expected: 1). */
#define SUPINE_LAWS(LAW)                                                                           \
  LAW(DEEP, "deep", 0.9, 0.4, (0, -0.2, 0), (6, 2.6, 15, 1, 16, 1.3), (0, -0.45, 0.45), 10, true,  \
      "displacement from full inflation, for any posture and volume")                              \
  LAW(PAPER, "paper", 0, 1, (0, 0, 0), (2, 1.5, 1.5, 1, 16, 1.4), (0, 0, 0), 0, false,             \
      "as Santhanam 2008 published it: displacement from the shape in the scan (implies "          \
      "--scanned none)")
/* clang-format on */
typedef enum supine_law {
#define SUPINE_LAW_ENUM(id, ...) SUPINE_LAW_##id,
  SUPINE_LAWS(SUPINE_LAW_ENUM)
#undef SUPINE_LAW_ENUM
      SUPINE_LAW_COUNT
} supine_law;

/** The physical model of a basis or a solve, without the geometry. The caller owns the arrays. */
typedef struct supine_model {
  supine_law law;
  supine_force_law force;
  supine_direction_law direction;
  double bend[3];          /**< bend of the path from full inflation to rest (supine_volume_bend) */
  const double *stiffness; /**< [N] stiffness E, or NULL for 1 everywhere */
  const double *lesions;   /**< [N] factors that multiply the normalised stiffness, or NULL */
  double reach;            /**< R of equilibrium.h, mm; 0 for the paper's transfer of force */
  double share[2];         /**< volume of each lung as a share of the healthy lung's volume */
} supine_model;

/** Return the model of healthy lungs of uniform stiffness with the constants of a law. */
supine_model supine_physics_model(supine_law law);

/** Names of the laws, indexed by supine_law and ended by NULL. */
extern const char *const supine_physics_law_names[SUPINE_LAW_COUNT + 1];

/** Set up the equilibrium of lungs with the model's stiffness, lesions and reach.
 * @param lungs        must outlive the equilibrium
 * @param equilibrium  in: points to NULL, or to an equilibrium of the same lungs, which is updated
 *                     for moved vertices; out: the equilibrium, which the caller destroys
 * @retval SUPINE_ERROR_ARGUMENT  softening without a reach: the matrix would change with gravity
 * Other statuses as supine_physics_equilibrium_create and
 * supine_physics_equilibrium_set_stiffness */
supine_status supine_physics_model_equilibrium(const supine_lungs *lungs, const supine_model *model,
                                               supine_equilibrium **equilibrium,
                                               supine_error *error);

#endif
