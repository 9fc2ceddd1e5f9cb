/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Repair and check the surfaces of lungs, whether from meshes or from label maps. */
#ifndef SUPINE_LUNGS_GATE_H
#define SUPINE_LUNGS_GATE_H

#include "sh/base/findings.h"

#include "precompute/lungs/lungs.h"

/** Where the surfaces come from. */
typedef struct supine_lungs_source {
  const char *name; /**< name of the first file, for messages */
  supine_axes axes; /**< axes of all files; AUTO if they differ */
  bool axes_given;
  bool units_given;
  const double *midline; /**< x of the midline, mm; NULL to find it from the lungs */
} supine_lungs_source;

/** Repair and check surfaces, and join them into lungs.
 *
 * Repairs are those of supine_mesh_repair; pieces below 1 % of their file's volume are dropped. The
 * longest side must be possible for lungs (an impossible one is only a warning if the user gave the
 * axes or units). The axes are compared with the shape (supine_mesh_anatomy_find). The side of a
 * single lung follows from its shape or, if that is unclear, from its position. Notes and warnings
 * go to `findings`.
 *
 * @param meshes     [count] changed in place
 * @param axes_hold  output: whether the shape fits LPS clearly better than all other axes
 * @retval SUPINE_ERROR_MESH  a size impossible for lungs, or both lungs in one piece
 * @retval SUPINE_ERROR_OPEN_SURFACE  a surface that is not closed
 * @retval the statuses of supine_lungs_create */
supine_status supine_lungs_gate(supine_mesh *meshes, size_t count,
                                const supine_lungs_source *source, supine_lungs *lungs,
                                bool *axes_hold, supine_findings *findings, supine_error *error);

#endif
