/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Where a point stands to a surface: how deep inside, and nearest to which triangle. */
#ifndef SUPINE_INSIDE_SURFACE_H
#define SUPINE_INSIDE_SURFACE_H

#include <stddef.h>
#include <stdint.h>

#include <supine/status.h>

typedef struct supine_inside_surface supine_inside_surface;

/** The place of a point. */
typedef struct supine_inside_place {
  double point[3];       /**< mm */
  double depth;          /**< mm to the surface; positive inside, negative outside */
  double nearest[3];     /**< the surface's nearest point, mm */
  size_t triangle;       /**< that it lies on */
  double barycentric[3]; /**< in it */
} supine_inside_place;

/** A tree of boxes over the triangles.
 * @param vertices   [., 3] mm, kept by the caller
 * @param triangles  [count, 3], 0 < count < 2^31, outwards; kept by the caller
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_inside_surface_create(const double *vertices, size_t count,
                                           const uint32_t *triangles,
                                           supine_inside_surface **surface, supine_error *error);
/** NULL is legal. */
void supine_inside_surface_destroy(supine_inside_surface *surface);

/** Finds the nearest point; depth is positive on both sides. Thread-safe.
 * @param near  the place of a point near by, which saves most of the work; NULL where none is known
 */
supine_inside_place supine_inside_surface_nearest(const supine_inside_surface *surface,
                                                  const double point[3],
                                                  const supine_inside_place *near);

/** Find the distance of each point [count, 3] to the surface, mm, into distance [count], and the
 * surface's nearest point into nearest [count, 3] where it is not NULL. Uses all cores. */
void supine_inside_surface_distances(const supine_inside_surface *surface, size_t count,
                                     const double *points, double *distance, double *nearest);

/** Finds the nearest point, and which side by the generalised winding number, 1 inside and 0
 * outside, so that small holes do no harm: inside where
 *
 *     (1 / 4 pi) sum over triangles of their solid angle seen from the point > 1/2
 *
 * Boxes farther than twice their radius count as one dipole. Thread-safe.
 * @param near  as above, from this function
 * Source: [Jacobson2013]; dipoles [Barill2018]. */
supine_inside_place supine_inside_surface_find(const supine_inside_surface *surface,
                                               const double point[3],
                                               const supine_inside_place *near);

#endif
