/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Which morph targets stand for a basis, and what their weights are. */
#ifndef SUPINE_EXPORT_TARGETS_H
#define SUPINE_EXPORT_TARGETS_H

#include "program/export/export.h"

/** J targets, each a mix of the basis' K modes:
 *
 *     target_j = unit_j sum over k of mix[k, j] u_k          base = rest + sum of offset_j mix u
 *     weight_j = (s sum over lm of modes[j, lm] Y_lm(g) - offset_j) / unit_j
 *
 * Where gains differ between axes, A = s + t bend, J as many follow of the bend's fields with the
 * same mix and modes and t in the place of s. */
typedef struct export_targets {
  size_t count;        /**< J, or 2 J */
  size_t mixes;        /**< J */
  bool mixed;          /**< false: mix is the identity */
  double *mix;         /**< [K, J] */
  double *modes;       /**< [J, (L+1)^2] */
  double *offset;      /**< [count] */
  double *unit;        /**< [count] */
  double loss_percent; /**< see export_glb_report */
  double count_mm; /**< mm per stored unit of length: 1, or the size of a count when quantised */
} export_targets;

/** Chooses targets for the options.
 * @retval SUPINE_ERROR_NUMERICAL, SUPINE_ERROR_MEMORY */
supine_status supine_export_targets_choose(const export_source *source,
                                           const export_glb_options *options,
                                           export_targets *targets, supine_error *error);

/** Releases them; a zeroed one is legal. */
void supine_export_targets_free(export_targets *targets);

/** Most targets; and the poses that normals are fitted to, more than which the bend's targets may
 * not make it. */
enum { EXPORT_TARGETS_MAX = SUPINE_MODES_MAX, EXPORT_POSES = 96 };

/** The lungs at a fraction of the breath. */
typedef struct export_pose {
  supine_pose basis;                  /**< the basis' */
  double weights[EXPORT_TARGETS_MAX]; /**< the targets' */
} export_pose;

/** @retval SUPINE_ERROR_NUMERICAL  the surface folds before: the pose is the reference surface */
supine_status supine_export_targets_at(const export_source *source, const export_breath *breath,
                                       const export_targets *targets, const double g[3],
                                       double fraction, export_pose *pose, supine_error *error);

/** Normals of the base [N, 3], unit length, and what each weight adds to them, [count, N, 3],
 * before they are made unit again: the least-squares fit to the surface's own over postures and the
 * breath.
 * @retval SUPINE_ERROR_NUMERICAL, SUPINE_ERROR_MEMORY */
supine_status supine_export_targets_normals(const export_source *source,
                                            const export_breath *breath,
                                            const export_targets *targets, float *base,
                                            float *added, supine_error *error);

/** Target `j` for a weight of 1, in stored units, xyz [N, 3]. */
void supine_export_targets_fill(const export_source *source, const export_targets *targets,
                                size_t j, float *xyz);

/** The base, in stored units, xyz [N, 3]. */
void supine_export_targets_base(const export_source *source, const export_targets *targets,
                                float *xyz);

/** The J <= limit mixes that keep most of the displacement's mean square over vertices and
 * directions: mix [K, J] and modes [J, (L+1)^2], and what is lost.
 * @retval SUPINE_ERROR_NUMERICAL, SUPINE_ERROR_MEMORY */
supine_status supine_export_targets_reduce(const export_source *source, size_t limit,
                                           export_targets *targets, supine_error *error);

#endif
