/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file Make content of a grid of nodes over the lungs. */
#ifndef SUPINE_INSIDE_GRID_H
#define SUPINE_INSIDE_GRID_H

#include "precompute/inside/content.h"
#include "precompute/inside/shells.h"

/** Make a grid of the nodes inside the lungs and those outside within a cell's diagonal, so that
 * every point inside lies between nodes.
 *
 * @param like     gives the axes: nodes are every n-th node of it, within its box. NULL:
 *                 along x, y, z
 * @param spacing  mm between nodes; with `like`, rounded to a multiple of its spacing, at least 1
 * @param margin   mm by which the grid's box extends beyond the lungs'; the field fades out there
 * @param content  zero-initialised
 * @retval SUPINE_ERROR_ARGUMENT  a spacing that is not positive, more than 2^31 nodes
 * @retval SUPINE_ERROR_MESH      no node is inside a lung
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_inside_content_grid(const supine_inside_shells *shells,
                                         const supine_image *like, double spacing, double margin,
                                         supine_inside_content *content, supine_error *error);

#endif
