/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file The surfaces of an open basis, lung by lung, to find the lung that a point is in. */
#ifndef SUPINE_INSIDE_SHELLS_H
#define SUPINE_INSIDE_SHELLS_H

#include <stdbool.h>

#include <supine/runtime.h>

#include "precompute/inside/surface.h"

/** One lung's surface. */
typedef struct supine_inside_shell {
  size_t begin; /**< index in the basis of the lung's first vertex */
  size_t vertex_count;
  double *vertices; /**< [vertex_count, 3] positions in the scan, mm */
  size_t triangle_count;
  uint32_t *triangles; /**< [triangle_count, 3], vertices counted from `begin` */
  double edge;         /**< mean length of an edge, mm */
  supine_inside_surface *surface;
} supine_inside_shell;

typedef struct supine_inside_shells {
  const supine_basis *basis; /**< owned by the caller; must outlive the shells */
  size_t count;
  supine_inside_shell shell[SUPINE_LUNGS_MAX];
  supine_pose scan; /**< pose in the scan, in which content is given */
} supine_inside_shells;

/** Extract each lung's surface as it is in the scan.
 * @param shells  output; release with supine_inside_shells_free
 * @retval SUPINE_ERROR_MESH       a lung has no triangle, or a triangle joins two lungs
 * @retval SUPINE_ERROR_FORMAT     the basis is itself content of lungs, not their surface
 * @retval SUPINE_ERROR_NUMERICAL  the basis cannot reach the scan's volume
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_inside_shells_create(const supine_basis *basis, supine_inside_shells *shells,
                                          supine_error *error);
void supine_inside_shells_free(supine_inside_shells *shells);

/** Find the displacement of each vertex of a lung by each of the K modes, at weight 1 and gain 1.
 * @param displacement  [vertex_count, 3, K] output, mm */
void supine_inside_shell_displacement(const supine_inside_shells *shells, size_t lung,
                                      double *displacement);

/** The last places that a search found in each lung, to search faster for a point nearby. */
typedef struct supine_inside_walk {
  bool known[SUPINE_LUNGS_MAX];
  supine_inside_place place[SUPINE_LUNGS_MAX]; /**< [lung] place of an earlier point */
  size_t lung;                                 /**< lung found for the last point */
} supine_inside_walk;

/** Return the lung that a point is in, or the nearest lung; walk->place[lung] is the point's place.
 * @param walk  zeroed for the first point
 * @param far   mm; for a point farther from the surface than this, the place may be that of an
 *             earlier point on the same side; with INFINITY, it is always the point's own place */
size_t supine_inside_shells_find(const supine_inside_shells *shells, const double point[3],
                                 double far, supine_inside_walk *walk);

#endif
