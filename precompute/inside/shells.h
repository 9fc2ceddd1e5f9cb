/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file Extract the surface of each lung from an open basis, to find the lung around a point. */
#ifndef SUPINE_INSIDE_SHELLS_H
#define SUPINE_INSIDE_SHELLS_H

#include <stdbool.h>

#include <supine/runtime.h>

#include "mesh/mesh.h"
#include "precompute/lungs/surface.h"

typedef struct supine_inside_shell {
  size_t begin; /**< index of the lung's first vertex in the basis */
  size_t vertex_count;
  double *vertices; /**< [vertex_count, 3] positions in the scan, mm */
  size_t triangle_count;
  uint32_t *triangles; /**< [triangle_count, 3] vertex indices minus `begin` */
  double edge;         /**< mean length of the edges, mm */
  supine_lungs_surface *surface;
} supine_inside_shell;

typedef struct supine_inside_shells {
  const supine_basis *basis; /**< owned by the caller; must outlive the shells */
  size_t count;
  supine_inside_shell shell[SUPINE_LUNGS_MAX];
  supine_pose scan; /**< pose that deforms the lungs to their shape in the scan */
} supine_inside_shells;

/** Extract each lung's surface as it is in the scan.
 * @param shells  output; release with supine_inside_shells_free, also after an error */
supine_status supine_inside_shells_create(const supine_basis *basis, supine_inside_shells *shells,
                                          supine_error *error);
void supine_inside_shells_free(supine_inside_shells *shells);

/** Find the largest displacement of a vertex from the scan to the states that the basis has: rest,
 * full inflation and the default volume, in postures all around.
 * @param largest  written, mm */
supine_status supine_inside_shells_reach(const supine_inside_shells *shells, double *largest,
                                         supine_error *error);

/** Find the displacement of each vertex of a lung by each mode at weight 1, not scaled further.
 * @param displacement  [vertex_count, 3, modes] output, mm */
void supine_inside_shell_displacement(const supine_inside_shells *shells, size_t lung,
                                      double *displacement);

/** Results of earlier searches, which speed up the search for a nearby point. */
typedef struct supine_inside_walk {
  bool known[SUPINE_LUNGS_MAX];                /**< [lung] whether `place` is set */
  supine_inside_place place[SUPINE_LUNGS_MAX]; /**< [lung] last result for this lung's surface */
  size_t lung;                                 /**< index of the lung found for the last point */
} supine_inside_walk;

/** Return the index of the lung that contains a point, or else of the nearest lung. Write the
 * point's position relative to the surface of that lung to walk->place[lung].
 * @param walk  results for earlier points; zeroed for the first point
 * @param far   mm; if the point is farther from the surface than this, walk->place[lung] may keep
 *              the result of an earlier point on the same side of the surface (INFINITY: never) */
size_t supine_inside_shells_find(const supine_inside_shells *shells, const double point[3],
                                 double far, supine_inside_walk *walk);

/** Numbers of points inside the lungs, as read and in other units and axes. */
typedef struct supine_inside_reading {
  size_t tested, as_read; /**< points tested (at most 999, evenly chosen), and those inside */
  size_t inside;          /**< largest number inside among all readings */
  /** Unit and axes of that reading, such as "cm" and "RAS"; "" if they are those in which the
   * points were read. Both are "" if these leave at most three times as many outside. */
  char unit[4], axes[4];
} supine_inside_reading;

/** Compare the axes and units in which points were read with others: mm, cm and m; RAS, and the
 * frames that mirror one axis. A patient's points lie inside the lungs in the right one.
 * @param load  axes and units in which the points were read */
void supine_inside_shells_reading(const supine_inside_shells *shells,
                                  const supine_mesh_load_options *load, const double *points,
                                  size_t count, supine_inside_reading *reading);

/** Compute the mean displacement of the hila by each mode at weight and gain 1. The hilum is that
 * of supine_lungs_is_hilar.
 * @param mean   [lungs, 3, modes] written, mm; from the file, if it holds structures inside lungs
 * @param known  whether the file determines it, written
 * Return an error only if memory is refused. */
supine_status supine_inside_hilum(const supine_basis *basis, double *mean, bool *known,
                                  supine_error *error);

#endif
