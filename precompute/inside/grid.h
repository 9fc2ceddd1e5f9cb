/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * A grid of nodes over the lungs, as content. */
#ifndef SUPINE_INSIDE_GRID_H
#define SUPINE_INSIDE_GRID_H

#include "precompute/inside/content.h"
#include "precompute/inside/shells.h"

/** Nodes inside the lungs, and those outside whose distance is less than the diagonal of a cell, so
 * that every point inside lies between nodes that are there.
 *
 * @param like     axes to take: nodes are every n-th node of its, the box within its box. NULL:
 *                 along x, y, z
 * @param spacing  mm between nodes; with `like`, at least about this far
 * @param margin   mm that the grid's box reaches beyond the lungs'; there are no nodes, but the
 *                 field that is written fades out in it
 * @param content  zero-initialised
 * @retval SUPINE_ERROR_ARGUMENT  a spacing that is not positive, more than 2^31 nodes
 * @retval SUPINE_ERROR_MESH      no node is inside a lung
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_inside_content_grid(const supine_inside_shells *shells,
                                         const supine_image *like, double spacing, double margin,
                                         supine_inside_content *content, supine_error *error);

#endif
