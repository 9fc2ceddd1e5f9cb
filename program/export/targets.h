/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Compute the morph targets of a basis and their weights. */
#ifndef SUPINE_EXPORT_TARGETS_H
#define SUPINE_EXPORT_TARGETS_H

#include "program/export/export.h"

enum { EXPORT_TARGETS_MAX = 2 * SUPINE_MODES_MAX };

/** Offset and unit of the weight of each target of one lung. They keep weights within [0, 1], to
 * which engines clamp them, for every direction of gravity and every volume of the breath:
 *
 *     base = vertex - middle + sum over j of offset_j field_j        target_j = unit_j field_j
 *     weight_j = (amount_j - offset_j) / unit_j
 *
 * The basis has K modes with weights v_k. The gain along an axis is s + t bend[axis]. For k < K,
 * field_k is the displacement by mode k, and amount_k = s v_k. If bend is not 0, each mode has a
 * second field, field_(K + k): field_k times bend[axis] along each axis; amount_(K + k) = t v_k */
typedef struct export_weights {
  double offset[EXPORT_TARGETS_MAX];
  double unit[EXPORT_TARGETS_MAX];
} export_weights;

typedef struct export_targets {
  size_t count;     /**< number of targets of a lung: one or two for each mode */
  double middle[3]; /**< centre of the box of the vertices, mm */
  double reach;     /**< half of the longest edge of the box, mm */
  export_weights lung[SUPINE_LUNGS_MAX];
} export_targets;

/** Choose the targets of every lung.
 * @param breath  tidal volume, mL
 * @retval SUPINE_ERROR_NUMERICAL  the surface folds before the end of the breath */
supine_status supine_export_targets_choose(const export_source *source, double breath,
                                           export_targets *targets, supine_error *error);

/** Compute the weights of a lung's targets, [count], in a pose. */
void supine_export_targets_weights(const export_source *source, const export_targets *targets,
                                   const supine_pose *pose, size_t lung, double *weights);

/** Compute the displacement of field `j` at a vertex, mm. */
void supine_export_targets_field(const export_source *source, size_t vertex, size_t j, double u[3]);

/** Compute the position of a vertex of the base mesh, mm from `targets->middle`. */
void supine_export_targets_base(const export_source *source, const export_targets *targets,
                                size_t lung, size_t vertex, double xyz[3]);

/** Linearise the surface's normals about supine: compute the normals `base` of the base mesh,
 * [N, 3], and the vectors `added` that each target adds to them at weight 1, [count, N, 3].
 * @param order  [N] order in which vertices are written. Vectors are rounded so that they compress
 *               well in this order. Those of a target that turns the normals of a lung by less than
 *               2.5 degrees (RMS) become 0. NULL if vectors are not to be rounded
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_export_targets_normals(const export_source *source, double breath,
                                            const export_targets *targets, const uint32_t *order,
                                            float *base, float *added, supine_error *error);

#endif
