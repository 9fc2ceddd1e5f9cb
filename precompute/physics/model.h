/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Constants of the displacement laws "deep" and "paper", and the physical model made from them. */
#ifndef SUPINE_MODEL_H
#define SUPINE_MODEL_H

#include "precompute/physics/equilibrium.h"
#include "precompute/physics/force.h"
#include "precompute/physics/strain.h"

/* clang-format off */
/** The displacement laws: LAW(identifier, name, base, gain, box, c, shear, bend, reach, pair,
 * from_scan, help text).
 * Of these, base, gain, box and pair are members of supine_force_law, c and shear are members of
 * supine_direction_law, and bend, reach and from_scan are members of supine_model.
 *
 * The constants of [Santhanam2008], Table I, are not available. The direction constants c are fits:
 * "paper" to 4-D CT landmarks of ten patients (DIR-Lab), "deep" to the full breaths of ten others
 * (DIR-Lab COPDgene). These patients lie supine, so gravity runs from front to back. Therefore
 * base, gain and the y coefficient of `box` cannot be determined separately. The gain of "deep" is
 * an assumption: the force is 0.8 on the uppermost and 1.2 on the lowest tissue (at the mean
 * of y). This agrees with Milic-Emili (J Appl Physiol 1966), who found lower regions emptier.
 *
 * The shear explains forward and backward motion of full breaths, which grows from apex to base.
 * Its least-squares value is 0.50 (SD 0.31) in five pairs of Lung250M-4B and five of COPDgene; 0.4,
 * the mean of the first five, explains 45 % of the squared motion of the others, and 0 explains
 * 38 % (tests/evidence/breaths.py). With a shear, a y coefficient of -0.15 instead of -0.2 keeps
 * the ventilation of the lowest third of supine lungs, divided by that of the uppermost, in the
 * measured range (tests/evidence/evidence.py) and fits the full breaths equally well.
 *
 * The bend (curvature of a vertex's path from full inflation to rest) has one free constant, 0.45,
 * chosen on ten quiet breaths (DIR-Lab 4-D CT). Displacements with this bend, scaled by one factor
 * for each patient, explain 78 % of the squared motion (median; 53 to 87 %), without bend 47 %.
 *
 * The laws leave out the weight of the heart on the lung below it. A weight that raises the left
 * lung's share of a breath from 48 to 49.5 % when lying on the left (published: 58 %) makes prone
 * breaths worse: the ventilation of the lowest quarter of the lungs, divided by that of the
 * uppermost, rises from 1.4 to 1.6 (expected: 1). */
#define SUPINE_LAWS(LAW)                                                                           \
  LAW(DEEP, "deep", 0.875, 0.4, (0, -0.15, 0), (6, 2.6, 15, 1, 16, 1.3), 0.4, (0, -0.45, 0.45), 10,   \
      true, false, "displacement from full inflation, for any posture and volume")                              \
  LAW(PAPER, "paper", 0, 1, (0, 0, 0), (2, 1.5, 1.5, 1, 16, 1.4), 0, (0, 0, 0), 0, false, true,    \
      "as Santhanam 2008 published it: displacement from the shape in the scan (whose "            \
      "state is not used)")
/* clang-format on */
typedef enum supine_law {
#define SUPINE_LAW_ENUM(id, ...) SUPINE_LAW_##id,
  SUPINE_LAWS(SUPINE_LAW_ENUM)
#undef SUPINE_LAW_ENUM
      SUPINE_LAW_COUNT
} supine_law;

/** The physical model of lungs, without their geometry. The caller owns the arrays. */
typedef struct supine_model {
  supine_law law;
  supine_force_law force;
  supine_direction_law direction;
  double bend[3]; /**< [axis] curvature of each vertex's path from full inflation to rest */
  const double *stiffness; /**< [vertices] stiffness; NULL for 1 everywhere */
  const double *lesions; /**< [vertices] factors that multiply the normalised stiffness, or NULL */
  supine_strain *strain; /**< effect of stiffness and lesions if reach > 0, or NULL; not owned */
  bool from_scan;        /**< whether displacements count from the scan, in every posture, instead
                            of from full inflation */
  double reach;          /**< smoothing length of force, mm; 0 for the method of [Santhanam2008] */
  double share[2];       /**< volume of each lung divided by its volume without disease */
} supine_model;

/** Return the model of healthy lungs of uniform stiffness under a displacement law. */
supine_model supine_physics_model(supine_law law);

/** Names of the displacement laws, indexed by supine_law and ended by NULL. */
extern const char *const supine_physics_law_names[SUPINE_LAW_COUNT + 1];

/** Set up the equilibrium of lungs with the smoothing length of a model or, without one,
 * with its stiffness and lesions.
 * @param lungs        must outlive the equilibrium
 * @param equilibrium  in: points to NULL, or to an equilibrium of the same lungs, which is updated
 *                     for moved vertices; out: the equilibrium, which the caller destroys */
supine_status supine_physics_model_equilibrium(const supine_lungs *lungs, const supine_model *model,
                                               supine_equilibrium **equilibrium,
                                               supine_error *error);

#endif
