/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Compute the morph targets of a glTF file from a basis, and their weights. */
#ifndef SUPINE_EXPORT_TARGETS_H
#define SUPINE_EXPORT_TARGETS_H

#include <supine/runtime.h>

#include "program/view/export/packed.h"

enum { EXPORT_TARGETS_MAX = 2 * SUPINE_MODES_MAX };

/** Offset and unit of each morph target of one lung.
 *
 * The basis has K modes and a constant bend[axis] for each axis (supine_volume_bend). It gives the
 * displacement of a lung as the sum over j of amount_j field_j; only amounts depend on gravity and
 * volume. s and t follow from the volume: s + t bend[axis] multiplies displacements along an axis.
 *
 *     field_j     displacement by mode j          amount_j      s times the weight of mode j
 *     field_(K+j) bend[axis] times field_j        amount_(K+j)  t times the weight of mode j
 *
 * If bend is 0, there are only the first K. In the file, a lung has a base mesh and a morph target
 * for each field. The base plus all weight_j target_j is its shape:
 *
 *     base = reference position - export_targets.middle + sum over j of offset_j field_j
 *     target_j = unit_j field_j            weight_j = (amount_j - offset_j) / unit_j
 *
 * Offset and unit keep the weights within [0, 1], to which viewers clamp them, for every direction
 * of gravity and every volume of the breath. In another simulator's fields over gravity and volume,
 * whose weights differ by lung and follow its volume, they do so for every simulated volume. */
typedef struct export_weights {
  double offset[EXPORT_TARGETS_MAX];
  double unit[EXPORT_TARGETS_MAX];
} export_weights;

typedef struct export_targets {
  const supine_basis *basis;
  const supine_basis_info *info; /**< of `basis` */
  double breath;                 /**< tidal volume, mL */
  size_t count;                  /**< number of morph targets of a lung: one or two for each mode */
  double middle[3];              /**< centre of the bounding box of all vertices, mm */
  double half_extent; /**< half of the longest edge of the bounding box of all vertices, mm */
  export_weights lung[SUPINE_LUNGS_MAX];
} export_targets;

/** Choose the morph targets of every lung for a breath of `breath` mL. */
supine_status supine_export_targets_choose(const supine_basis *basis, double breath,
                                           export_targets *targets, supine_error *error);

/** Compute the pose during a breath of `breath` mL, with gravity along the unit vector `g`. The
 * `fraction` is 0 at rest (in the scan if rest is unknown) and 1 at the end of inspiration; another
 * simulator's fields have no breath. */
supine_status supine_export_breath_pose(const supine_basis *basis, double breath, const double g[3],
                                        double fraction, supine_pose *pose, supine_error *error);

/** Compute the weights [targets->count] at which the morph targets of a lung show a pose. */
void supine_export_targets_weights(const export_targets *targets, const supine_pose *pose,
                                   size_t lung, double *weights);

/** Compute the displacement `u`, mm, of a vertex by field j of export_weights. */
void supine_export_targets_field(const export_targets *targets, size_t vertex, size_t j,
                                 double u[3]);

/** Compute the position of a vertex in a lung's base mesh, mm, relative to `targets->middle`. */
void supine_export_targets_base(const export_targets *targets, size_t lung, size_t vertex,
                                double xyz[3]);

/** Compute the normals `base` [N, 3] of the base mesh, and the change of the normals by each morph
 * target at weight 1, `added` [targets->count, N, 3]. Both linearise the normals of the deformed
 * surface about the supine posture.
 * @param order  order in which the file stores vertices
 * @param exact  false to round `added` so that it compresses well in this order, and to set it to 0
 *               for a target that turns a lung's normals by less than 2 degrees (RMS) */
supine_status supine_export_targets_normals(const export_targets *targets,
                                            const export_order *order, bool exact, float *base,
                                            float *added, supine_error *error);

#endif
