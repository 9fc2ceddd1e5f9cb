/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Repair and check the surfaces of lungs, whether from meshes or from label maps. */
#ifndef SUPINE_LUNGS_GATE_H
#define SUPINE_LUNGS_GATE_H

#include <supine/findings.h>

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
 * Components with less than 1 % of the volume of their surface are dropped. Open surfaces,
 * impossible sizes (a warning if the user gave the units), components deep inside others and very
 * long, thin tips are refused. Thin tips, flat ends and axes that the shape contradicts are warned
 * of. The side of a single lung follows from its shape or, if that is unclear, from its position.
 * @param meshes     [count] changed in place
 * @param axes_hold  output: whether the shape fits the axes LPS clearly better than all other axes
 * @param findings   notes and warnings are added
 */
supine_status supine_lungs_gate(supine_mesh *meshes, size_t count,
                                const supine_lungs_source *source, supine_lungs *lungs,
                                bool *axes_hold, supine_findings *findings, supine_error *error);

#endif
