/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * The checks that every surface of lungs passes, from meshes or label maps. */
#ifndef SUPINE_LUNGS_GATE_H
#define SUPINE_LUNGS_GATE_H

#include "sh/base/findings.h"

#include "precompute/lungs/lungs.h"

/** How the surfaces came. */
typedef struct supine_lungs_source {
  const char *name;      /**< the first file, for messages */
  supine_axes axes;      /**< that they were read in; AUTO: several */
  bool axes_given;       /**< the user named the axes: impossible sizes are then only warned of */
  bool units_given;      /**< likewise the units */
  const double *midline; /**< as of supine_lungs_create */
} supine_lungs_source;

/** Mends and checks surfaces, and joins them into lungs.
 *
 * Duplicate and loose triangles are dropped, reversed ones turned, closed surfaces that touch
 * parted, and pieces below 1 % of their file's volume dropped. The longest side must be one that
 * lungs have. The axes are compared with the shape (supine_mesh_anatomy_find). A single lung's side
 * is told from its shape, or else from its place. All that was done or found goes to `findings`.
 *
 * @param meshes     [count] changed in place
 * @param axes_hold  optional, written: the shape agrees with the axes, and no others come near
 * @retval SUPINE_ERROR_MESH  a size that no lungs have, both lungs in one piece; and those of
 *                            supine_lungs_create */
supine_status supine_lungs_gate(supine_mesh *meshes, size_t count,
                                const supine_lungs_source *source, supine_lungs *lungs,
                                bool *axes_hold, supine_findings *findings, supine_error *error);

#endif
