/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Repair and check the surfaces of lungs, whether from meshes or from label maps. */
#ifndef SUPINE_LUNGS_GATE_H
#define SUPINE_LUNGS_GATE_H

#include "base/findings.h"

#include "precompute/lungs/lungs.h"

/** Origin of the surfaces, and what the user stated about them. */
typedef struct supine_lungs_source {
  const char *name; /**< name of the first file, for messages */
  supine_axes axes; /**< axes of all files; SUPINE_AXES_AUTO if files differ in their axes */
  bool units_given;
  const double *midline; /**< x of the midline, mm; NULL to find it from the lungs */
  int side;              /**< side of a single lung: +1 left, -1 right; 0 to find it */
} supine_lungs_source;

/** Repair and check surfaces, and join them into lungs.
 *
 * - Surfaces are repaired by supine_mesh_repair. Connected components with less than 1 % of
 *   the volume of their surface are dropped.
 * - The longest side of the bounding box, its height, and the volume must be possible for lungs. If
 *   the user gave the units, an impossible size is only a warning.
 * - No component may reach deep into another. A tip of a lung with little volume is a warning, and
 *   refused if it is very long. A flat end towards the head or the feet is a warning.
 * - Axes that the shape contradicts (supine_mesh_anatomy_find) are a warning.
 * - The side of a single lung follows from its shape or, if that is unclear, from its position.
 * @param meshes     [count] changed in place
 * @param axes_hold  output: whether the shape fits the axes LPS clearly better than all other axes
 * @param findings   notes and warnings are added
 */
supine_status supine_lungs_gate(supine_mesh *meshes, size_t count,
                                const supine_lungs_source *source, supine_lungs *lungs,
                                bool *axes_hold, supine_findings *findings, supine_error *error);

#endif
