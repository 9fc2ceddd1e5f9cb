/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Regional alveolar expandability a ([Santhanam2008] III-E): how readily each part of a lung
 * expands. The stiffness of a vertex is E = 1/a.
 *
 * Only ratios count, as E is scaled to geometric mean 1. Vertices are in the order of lungs.h: the
 * left lung's first, and within each lung in the order in which its mesh file lists them. */
#ifndef SUPINE_EXPANDABILITY_H
#define SUPINE_EXPANDABILITY_H

#include "precompute/lungs/lungs.h"

typedef enum supine_expandability_shape {
  SUPINE_EXPANDABILITY_UNIFORM = 0, /**< 1 everywhere */
  SUPINE_EXPANDABILITY_LINEAR,      /**< `from` + (`to` - `from`) t, with t 0 to 1 along an axis */
  SUPINE_EXPANDABILITY_EXPONENTIAL  /**< `from` * (`to` / `from`)^t, with t 0 to 1 along an axis */
} supine_expandability_shape;

/** Expandability of a vertex as a function of its coordinate t along one axis of the bounding box
 * of the lungs, from 0 at one face to 1 at the opposite face (supine_lungs_box_coordinates). */
typedef struct supine_expandability_law {
  supine_expandability_shape shape;
  int axis;        /**< 0: from midline to outside, 1: from back to front, 2: from apex to base */
  double from, to; /**< relative expandability at the start and at the end of the axis, > 0 */
} supine_expandability_law;

/** Compute the expandability a [N] of all vertices by a law whose shape is not
 * SUPINE_EXPANDABILITY_UNIFORM. */
void supine_lungs_expandability_regional(const supine_lungs *lungs,
                                         const supine_expandability_law *law, double *a);

/** Read the expandability a [count] from the column `expandability` of a CSV file. Lines are in the
 * order of the vertices, or in any order if a column `vertex` numbers the vertices from 0. Empty
 * lines, and lines that begin with #, are skipped. Every vertex must have one positive value. */
supine_status supine_lungs_expandability_load(const char *path, size_t count, double *a,
                                              supine_error *error);

#endif
