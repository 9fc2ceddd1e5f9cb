/* SPDX-License-Identifier: MIT */
/** @file Decide by its shape whether a part inside the lungs is compact, as nodules and tumours are,
 * but vessels, airways and lobes are not. Compact parts keep their size and shape. */
#ifndef SUPINE_COMPACT_H
#define SUPINE_COMPACT_H

#include "mesh/mesh.h"

/** Limits of the volume of a compact part, mL. A ball of 1 mL has a radius of 6 mm: smaller ones span
 * hardly more than a cell of a displacement field, and their loss of volume is below its error. Over
 * 30 mL (a radius of 19 mm) are consolidation and collapse, which follow the lung around them. */
#define SUPINE_COMPACT_LEAST_ML 1.0
#define SUPINE_COMPACT_MOST_ML 30.0

/** Return whether a solid part is compact: its volume, mL, is within the limits, and it is neither
 * slender nor branched.
 * @param covariance  of the positions in the part, mm^2 */
bool supine_mesh_is_compact(double volume, const double covariance[3][3]);

/** Compute the volume of the solid inside a closed surface, mL, and the covariance of the positions
 * in it, mm^2. Its cavities, which are components that are turned inwards, count as solid. The
 * volume of an open surface is 0.
 * @retval SUPINE_ERROR_MEMORY  out of memory */
supine_status supine_mesh_solid(const supine_mesh *mesh, double *volume, double covariance[3][3]);

#endif
