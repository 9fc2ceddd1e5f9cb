/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Compute the morph targets of a glTF file from a basis, and their weights. */
#ifndef SUPINE_EXPORT_TARGETS_H
#define SUPINE_EXPORT_TARGETS_H

#include "program/export/export.h"

enum { EXPORT_TARGETS_MAX = 2 * SUPINE_MODES_MAX };

/** Offset and unit of each morph target of one lung. The displacement of a lung is a sum of fixed
 * fields times amounts that depend on gravity and volume. Each field gives a morph target:
 *
 *     vertex - middle + sum over j of amount_j field_j = base + sum over j of weight_j target_j
 *     base = vertex - middle + sum over j of offset_j field_j
 *     target_j = unit_j field_j
 *     weight_j = (amount_j - offset_j) / unit_j
 *
 *     vertex   position on the reference surface
 *     middle   centre of the bounding box
 *     field_j  for j < K, the number of modes: displacement by mode j, as stored in the basis;
 *              field_(K+j), if bend is not 0: field_j times bend[axis] along each axis
 *     amount   amount_j = s v_j and amount_(K+j) = t v_j, where v_j is the weight of mode j, and
 *              s + t bend[axis] is the gain: the factor of the displacement along an axis
 *     bend     constants of the basis, see supine_volume_bend
 *
 * Offset and unit keep the weights within [0, 1], to which viewers clamp them, for every direction
 * of gravity and every volume of the breath. */
typedef struct export_weights {
  double offset[EXPORT_TARGETS_MAX];
  double unit[EXPORT_TARGETS_MAX];
} export_weights;

typedef struct export_targets {
  size_t count;       /**< number of morph targets of a lung: one or two for each mode */
  double middle[3];   /**< centre of the bounding box of all vertices, mm */
  double half_extent; /**< half of the longest edge of the bounding box of all vertices, mm */
  export_weights lung[SUPINE_LUNGS_MAX];
} export_targets;

/** Choose the morph targets of every lung for a breath of `breath` mL.
 * @retval SUPINE_ERROR_NUMERICAL  the surface folds before the end of the breath */
supine_status supine_export_targets_choose(const export_source *source, double breath,
                                           export_targets *targets, supine_error *error);

/** Compute the weights [targets->count] at which the morph targets of a lung show a pose. */
void supine_export_targets_weights(const export_source *source, const export_targets *targets,
                                   const supine_pose *pose, size_t lung, double *weights);

/** Compute the vector `u`, mm, at a vertex of the displacement field on which morph target `j` is
 * based (field_j of export_weights). */
void supine_export_targets_field(const export_source *source, size_t vertex, size_t j, double u[3]);

/** Compute the position of a vertex in a lung's base mesh, mm, relative to `targets->middle`. */
void supine_export_targets_base(const export_source *source, const export_targets *targets,
                                size_t lung, size_t vertex, double xyz[3]);

/** Compute the normals `base` [N, 3] of the base mesh, and the vectors `added` [count, N, 3] that
 * each morph target at weight 1 adds to them. They linearise the normals of the deformed surface
 * about the supine posture.
 * @param order  [N] order in which the file stores vertices. `added` is then rounded so that it
 *               compresses well in this order, and is 0 for a target that turns a lung's normals
 *               by less than 2.5 degrees (RMS). NULL to keep `added` exact
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_export_targets_normals(const export_source *source, double breath,
                                            const export_targets *targets, const uint32_t *order,
                                            float *base, float *added, supine_error *error);

#endif
