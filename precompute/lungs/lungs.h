/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * The lungs of one person: join surfaces, sort them into left and right, and measure them. */
#ifndef SUPINE_LUNGS_H
#define SUPINE_LUNGS_H

#include "base/arena.h"

#include "mesh/mesh.h"

/** One or two lungs as a single surface whose vertices and triangles are grouped by lung, within
 * each lung in the order of the input. With two lungs, the left one is lung 0. */
typedef struct supine_lungs {
  supine_mesh mesh;
  supine_topology topology;
  size_t lung_count;        /**< 1 or 2 */
  size_t lung_begin[3];     /**< lung j: lung_begin[j] <= vertex < lung_begin[j + 1] */
  size_t triangle_begin[3]; /**< lung j: triangle_begin[j] <= triangle < triangle_begin[j + 1] */
  int side[2];              /**< [lung] +1 left, -1 right */
  bool reversed[2];         /**< whether the lung's triangles faced inwards and were reversed */
  double volume[2];         /**< [lung] volume that its surface encloses, mL */
  double low[2][3];         /**< [lung] bounding box, mm */
  double high[2][3];
  double minimum[3]; /**< bounding box over all lungs, mm */
  double maximum[3];
  double *scanned; /**< [vertices, 3] positions in the scan, mm, if `mesh` shows full inflation
                      instead of the scan; otherwise NULL */
  double midline;  /**< x of the sagittal plane between left and right, mm */
} supine_lungs;

/** Join surfaces into one or two lungs.
 *
 * Components to the left and to the right of the centre of the common bounding box are two lungs if
 * the left ones hardly overlap the right ones in x. Otherwise all components are one lung. Unless
 * given, the midline is the centre of the bounding box for two lungs, and the face of the bounding
 * box nearest x = 0 for one. If the triangles of a lung face inwards, they are reversed.
 * @param meshes   [count] not changed
 * @param midline  x of the plane between left and right, mm; found if NULL
 * @param lungs    written on success; release with supine_lungs_free */
supine_status supine_lungs_create(const supine_mesh *meshes, size_t count, const double *midline,
                                  supine_lungs *lungs, supine_error *error);

/** Update the bounding boxes and the volumes, or only the volumes, after vertices have moved. */
void supine_lungs_measure(supine_lungs *lungs);
void supine_lungs_measure_volumes(supine_lungs *lungs);

/** Free the arrays; a zeroed struct is legal. */
void supine_lungs_free(supine_lungs *lungs);

/** Largest overlap of two lungs along an axis, as a share of the extent of the narrower lung; lobes
 * of one lung overlap more. */
#define SUPINE_LUNGS_MOST_OVERLAP 0.5

/** Divide connected components between the two sides of `middle` along an axis, by the mean of
 * their vertices. Only components with at least 5 % of all vertices count for a side's range.
 * @param above  [components] written: whether the mean is above `middle`
 * @param arena  for work space; if it has failed, `above` is not written
 * @return overlap of the two ranges divided by the narrower range; INFINITY if no component counts
 *   on a side */
double supine_lungs_sides(const supine_mesh *mesh, const supine_topology *topology, int axis,
                          double middle, supine_arena *arena, uint8_t *above);

/** Name a lung: "left" or "right". */
static inline const char *supine_lungs_name(const supine_lungs *lungs, size_t lung) {
  return lungs->side[lung] > 0 ? "left" : "right";
}

/** Return one lung as a mesh that shares the arrays of `lungs`. Its triangles index the vertices of
 * all lungs. */
static inline supine_mesh supine_lungs_part(const supine_lungs *lungs, size_t lung) {
  const size_t begin = lungs->triangle_begin[lung];
  return (supine_mesh){lungs->mesh.vertex_count, lungs->mesh.vertices,
                       lungs->triangle_begin[lung + 1] - begin, lungs->mesh.triangles + 3 * begin};
}

/** Compute the coordinates of a vertex in the bounding box of the lungs, each 0 to 1
 * ([Santhanam2008] (15)-(18)): X from the midline outwards, Y from the back to the front, Z from
 * the apex to the base. */
void supine_lungs_box_coordinates(const supine_lungs *lungs, size_t vertex, double box[3]);

#endif
