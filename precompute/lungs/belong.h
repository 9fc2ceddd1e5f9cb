/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Does something belong to these lungs? How much of it lies in them, and how far outside is the
 * rest: points, vertices, and voxels of labels or of an image. */
#ifndef SUPINE_LUNGS_BELONG_H
#define SUPINE_LUNGS_BELONG_H

#include <supine/findings.h>
#include <supine/inputs.h>

#include "precompute/lungs/surface.h"

/** Distance, mm, by which what lies in the lungs may lie outside their surface. */
#define SUPINE_LUNGS_RIM 5.0

/** How much of something lies outside the lungs. Zero-initialise, and set `rim`. */
typedef struct supine_lungs_belong {
  double rim;      /**< points farther outside than this count as outside, mm */
  size_t count;    /**< number of points */
  size_t outside;  /**< number of those that are outside */
  double farthest; /**< distance of the farthest, mm */
} supine_lungs_belong;

/** Add a point.
 * @param depth  below the surface, mm; negative outside */
void supine_lungs_belong_add(supine_lungs_belong *found, double depth);

/** Add points [count, 3], mm.
 * @param surface  of the lungs, with sides */
void supine_lungs_belong_add_points(supine_lungs_belong *found, const supine_lungs_surface *surface,
                                    size_t count, const double *points);

/** Return the share of the points that are outside; 0 without points. */
double supine_lungs_belong_share(const supine_lungs_belong *found);

/** Return the verdict of a row of the table of checks about the share of the points outside, and
 * warn if it is not SUPINE_INPUT_TAKEN.
 * @param what   what the points are, such as "landmarks" or "vertices of 'airways'"
 * @param lungs  which lungs, such as "first scan" */
supine_input_verdict supine_lungs_belong_judge(const supine_lungs_belong *found,
                                               supine_input_id row, const char *what,
                                               const char *lungs, supine_findings *findings);

/** Return whether a point lies between the lungs, where airways, vessels and lymph nodes do: nearer
 * to the midline than 0.35 of the distance of the outermost part of a lung.
 * @param low, high  box of the lungs, mm
 * @param side       0 with both lungs, +1 with a left lung alone, -1 with a right one */
bool supine_lungs_is_between(const double low[3], const double high[3], int side,
                             const double point[3]);

#endif
