/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file Find how deep a point is inside a surface, and the nearest triangle. */
#ifndef SUPINE_INSIDE_SURFACE_H
#define SUPINE_INSIDE_SURFACE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <supine/status.h>

typedef struct supine_inside_surface supine_inside_surface;

/** The place of a point relative to a surface. */
typedef struct supine_inside_place {
  double point[3];       /**< the point, mm */
  double depth;          /**< distance to the surface, mm; positive inside, negative outside */
  double nearest[3];     /**< the surface's nearest point, mm */
  size_t triangle;       /**< index of the triangle of the nearest point */
  double barycentric[3]; /**< barycentric coordinates of `nearest` in the triangle */
} supine_inside_place;

/** Build a tree of boxes over the triangles.
 * @param vertices   [vertices, 3] mm, must outlive the tree
 * @param triangles  [count, 3], 0 < count < 2^31, facing outwards; must outlive the tree
 * @param sides      whether supine_inside_surface_find will be called, which needs more memory
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_inside_surface_create(const double *vertices, size_t count,
                                           const uint32_t *triangles, bool sides,
                                           supine_inside_surface **surface, supine_error *error);
/** Free the tree; NULL is legal. */
void supine_inside_surface_destroy(supine_inside_surface *surface);

/** Find the surface point nearest to a point; its `depth` is positive on both sides. Thread-safe.
 * @param near  the place of a nearby point, which saves work, or NULL */
supine_inside_place supine_inside_surface_nearest(const supine_inside_surface *surface,
                                                  const double point[3],
                                                  const supine_inside_place *near);

/** Find the distance of each point [count, 3] to the surface, mm, into distance [count], and the
 * surface point nearest to it into nearest [count, 3] unless `nearest` is NULL. Uses all cores. */
void supine_inside_surface_distances(const supine_inside_surface *surface, size_t count,
                                     const double *points, double *distance, double *nearest);

/** Find the surface point nearest to a point, and the side of the point by the generalised winding
 * number, which tolerates small holes: it is inside if
 *
 *     (1 / 4 pi) sum over triangles of their solid angle seen from the point > 1/2
 *
 * A dipole approximates the triangles of a distant box of the tree. Thread-safe.
 * @param near  the place of a nearby point, found by this function, which saves work, or NULL
 * Sources: Jacobson, Kavan, Sorkine-Hornung, ACM Trans. Graph. 32(4), 2013; for the dipoles Barill,
 * Dickson, Schmidt, Levin, Jacobson, ACM Trans. Graph. 37(4), 2018. */
supine_inside_place supine_inside_surface_find(const supine_inside_surface *surface,
                                               const double point[3],
                                               const supine_inside_place *near);

#endif
