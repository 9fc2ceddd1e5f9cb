/* SPDX-License-Identifier: MIT */
/** @file Decide by its shape whether a part inside the lungs is compact, as nodules and tumours
 * are, but vessels, airways and lobes are not. Compact parts keep their size and shape. */
#ifndef SUPINE_COMPACT_H
#define SUPINE_COMPACT_H

#include "mesh/mesh.h"

/** Limits of the volume of a compact part, mL. A ball of 1 mL has a radius of 6 mm: smaller ones
 * span hardly more than a cell of a displacement field, and their loss of volume is below its
 * error. Over 30 mL (a radius of 19 mm) are consolidation and collapse, which follow the lung
 * around them. */
#define SUPINE_COMPACT_LEAST_ML 1.0
#define SUPINE_COMPACT_MOST_ML 30.0

/** Return whether a solid part is compact: its volume, mL, is within the limits, and it is neither
 * slender nor branched.
 * @param covariance  of the positions in the part, mm^2 */
bool supine_mesh_is_compact(double volume, const double covariance[3][3]);

/** Find the connected components of a mesh that are closed and compact; their cavities, which are
 * components that face inwards, count as solid and belong to them. Other components, such as a few
 * stray voxels of a label, do not change what a component is.
 * @param part   [vertex_count] written: 1 + index of the compact part of each vertex, or 0
 * @param count  written: number of compact parts
 * @retval SUPINE_ERROR_MEMORY  out of memory */
supine_status supine_mesh_find_compact(const supine_mesh *mesh, uint32_t *part, uint32_t *count);

#endif
