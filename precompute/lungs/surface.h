/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file Find how deep a point is inside a surface, and the nearest triangle. */
#ifndef SUPINE_INSIDE_SURFACE_H
#define SUPINE_INSIDE_SURFACE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <supine/status.h>

typedef struct supine_lungs_surface supine_lungs_surface;

/** The position of a point relative to a surface. */
typedef struct supine_inside_place {
  double point[3];       /**< the point whose position is described, mm */
  double depth;          /**< distance to the surface, mm; positive inside, negative outside */
  double nearest[3];     /**< point of the surface nearest to `point`, mm */
  size_t triangle;       /**< index of the triangle that contains `nearest` */
  double barycentric[3]; /**< barycentric coordinates of `nearest` in this triangle */
} supine_inside_place;

/** Build a tree of bounding boxes over the triangles of a surface.
 * @param vertices   [vertices, 3] mm, must outlive the tree
 * @param triangles  [count, 3], 0 < count < 2^31, facing outwards; must outlive the tree
 * @param sides      whether to allow supine_lungs_surface_find, which needs more memory */
supine_status supine_lungs_surface_create(const double *vertices, size_t count,
                                          const uint32_t *triangles, bool sides,
                                          supine_lungs_surface **surface, supine_error *error);
/** Update the tree after vertices have moved. Large relative motions make searches slower. */
void supine_lungs_surface_refit(supine_lungs_surface *surface);
/** Free a surface; NULL is allowed. */
void supine_lungs_surface_destroy(supine_lungs_surface *surface);

/** Destroy *surface; for SUPINE_FREED_BY. */
static inline void supine_lungs_surface_drop(supine_lungs_surface **surface) {
  supine_lungs_surface_destroy(*surface);
}

/** Find the surface point nearest to a point. The result's `depth` is the distance, without a sign
 * for the side of the surface. Thread-safe.
 * @param near  result for a nearby point, which speeds up the search, or NULL */
supine_inside_place supine_lungs_surface_nearest(const supine_lungs_surface *surface,
                                                 const double point[3],
                                                 const supine_inside_place *near);

/** Compute the distance of each point from the surface. Uses all cores.
 * @param points    [count, 3] mm
 * @param distance  [count] mm, written
 * @param nearest   [count, 3] surface point nearest to each point, mm, written; may be NULL */
void supine_lungs_surface_distances(const supine_lungs_surface *surface, size_t count,
                                    const double *points, double *distance, double *nearest);

/** Find the surface point nearest to a point, and whether the point is inside the surface. Small
 * holes are tolerated, because the side follows from the generalised winding number. A point is
 * inside if
 *
 *     (sum over all triangles of their solid angle seen from the point) / (4 pi) > 1/2
 *
 * The triangles of a distant box of the tree are approximated by a dipole. Thread-safe.
 * @param near  result of this function for a nearby point, which speeds up the search, or NULL
 * Sources: Jacobson, Kavan, Sorkine-Hornung, ACM Trans. Graph. 32(4), 2013; for the dipoles Barill,
 * Dickson, Schmidt, Levin, Jacobson, ACM Trans. Graph. 37(4), 2018. */
supine_inside_place supine_lungs_surface_find(const supine_lungs_surface *surface,
                                              const double point[3],
                                              const supine_inside_place *near);

#endif
