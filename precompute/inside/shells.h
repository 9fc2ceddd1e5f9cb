/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * The surfaces of an open basis, lung by lung, to tell what is inside which. */
#ifndef SUPINE_INSIDE_SHELLS_H
#define SUPINE_INSIDE_SHELLS_H

#include <stdbool.h>

#include <supine/runtime.h>

#include "precompute/inside/surface.h"

/** One lung's surface. */
typedef struct supine_inside_shell {
  size_t begin; /**< the basis's first vertex of it */
  size_t vertex_count;
  double *vertices; /**< [vertex_count, 3] mm, where the scan had them */
  size_t triangle_count;
  uint32_t *triangles; /**< [triangle_count, 3], vertices counted from `begin` */
  double edge;         /**< mean length of an edge, mm */
  supine_inside_surface *surface;
} supine_inside_shell;

typedef struct supine_inside_shells {
  const supine_basis *basis; /**< kept by the caller */
  size_t count;              /**< lungs, G */
  supine_inside_shell shell[SUPINE_LUNGS_MAX];
  supine_pose scan; /**< the scan's own state, in which content is given */
} supine_inside_shells;

/** Take the lungs' surfaces to where they were scanned.
 * @param shells  written; supine_inside_shells_free releases it
 * @retval SUPINE_ERROR_MESH    a lung without a triangle
 * @retval SUPINE_ERROR_FORMAT  the basis is itself content of lungs, not their surface
 * @retval SUPINE_ERROR_NUMERICAL  its volumes do not reach the scan's
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_inside_shells_create(const supine_basis *basis, supine_inside_shells *shells,
                                          supine_error *error);
void supine_inside_shells_free(supine_inside_shells *shells);

/** Displacements of a lung's vertices at weight and scale 1 of each mode.
 * @param displacement  [vertex_count, 3, K] mm, written */
void supine_inside_shell_displacement(const supine_inside_shells *shells, size_t lung,
                                      double *displacement);

/** Places of one point after another, each near the one before: what was found lately, by lung. */
typedef struct supine_inside_walk {
  bool known[SUPINE_LUNGS_MAX];
  supine_inside_place place[SUPINE_LUNGS_MAX]; /**< of some earlier point */
  size_t lung;                                 /**< the last answer */
} supine_inside_walk;

/** The lung that a point is in, or where it is in none, the nearest; walk->place[lung] is its
 * place.
 * @param walk  zeroed for the first point
 * @param far   mm: where the surface is known to be farther than this the place is left as it was,
 *              of an earlier point on the same side; INFINITY: never */
size_t supine_inside_shells_find(const supine_inside_shells *shells, const double point[3],
                                 double far, supine_inside_walk *walk);

#endif
