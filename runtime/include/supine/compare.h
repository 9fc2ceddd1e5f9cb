/* SPDX-License-Identifier: MIT */
/** @file
 * Compare poses: distances between deformed lungs, and ventilation by height.
 *
 * Averages are weighted by area. The weight a_i of vertex i is a third of the area of its triangles
 * on the reference surface, divided by the area of all triangles.
 *
 * Stability: growing. A minor version may change functions and structs without a replacement;
 * CHANGELOG.md names the change. */
#ifndef SUPINE_COMPARE_H
#define SUPINE_COMPARE_H

#include <stddef.h>

#include <supine/runtime.h>
#include <supine/status.h>

#ifdef __cplusplus
extern "C" {
#endif

/** Constants of one basis for comparing poses. Any number of threads may share them. */
typedef struct supine_compare supine_compare;

/** Compute the constants for comparing poses: the share a_i of each vertex i in the area of the
 * reference surface (top of this file), and the Gram matrix of the modes:
 *
 *     G[k, l] = sum over vertices i and axes j of a_i d_ij^2 c_ik c_il
 *
 * Mode k moves vertex i along the vector d_i, in proportion to c_ik; d_ij is coordinate j of d_i.
 * If supine_basis_info.vector is true, coefficients c_ijk replace d_ij c_ik. Cost: 3 N K^2 / 2
 * multiplications for N vertices and K modes, in one pass over the vertices.
 * @param basis    must outlive the comparison
 * @param compare  written; free it with supine_compare_destroy
 * @retval SUPINE_ERROR_MESH    the area of the surface is 0 or not finite
 * @retval SUPINE_ERROR_MEMORY  an allocation failed */
SUPINE_API supine_status supine_compare_create(const supine_basis *basis, supine_compare **compare,
                                               supine_error *error);
/** Free a comparison; NULL is legal. */
SUPINE_API void supine_compare_destroy(supine_compare *compare);

/** Return the area of the reference surface, mm^2. */
SUPINE_API double supine_compare_area(const supine_compare *compare);

/** Compute the distance between the positions of every vertex in two poses. Cost: one pass over the
 * vertices, with 3 K + 6 multiplications per vertex for K modes.
 * @param from      NULL for the reference surface
 * @param distance  [N] mm, written */
SUPINE_API supine_status supine_compare_distances(const supine_compare *compare,
                                                  const supine_pose *pose, const supine_pose *from,
                                                  float *distance);

/** Statistics of the distances between the positions of every vertex in two poses, mm. */
typedef struct supine_distance_statistics {
  double mean; /**< area-weighted mean */
  double rms;  /**< area-weighted root mean square */
  double p95;  /**< 95th percentile by area */
  double max;
} supine_distance_statistics;

/** Compute the statistics of distances exactly, in 32 passes over the vertices, without
 * allocation.
 * @param distance  [N] mm, none negative */
SUPINE_API void supine_compare_statistics(const supine_compare *compare, const float *distance,
                                          supine_distance_statistics *statistics);

/** Compute the energy of each band l of spherical harmonics: its squared displacement, averaged
 * over the area and all directions of gravity, at gains (factors of the displacement) of 1:
 *
 *     energy[l] = 1 / (4 pi) * sum over m of  M_lm^T G M_lm
 *
 * M_lm is the column of supine_basis_info.modes for the harmonic Y_lm, and G is the Gram matrix of
 * supine_compare_create. Reversed gravity reverses the displacements of odd bands, but not those of
 * even bands.
 * @param energy  [supine_basis_info.band + 1] mm^2, written */
SUPINE_API void supine_compare_energy(const supine_compare *compare, double *energy);

/** The part of one lung between two horizontal planes, and how much a breath inflates it. */
typedef struct supine_slab {
  double volume; /**< volume of the slab before the breath, mL */
  double gain;   /**< volume that the breath adds, mL; gain / volume is the regional expansion */
} supine_slab;

enum { SUPINE_SLABS_MAX = 64 };

/** Compute the ventilation of the lungs by height. Horizontal planes cut the lungs before a breath
 * into slabs of equal thickness, from the highest to the lowest point of all lungs. The gain of a
 * slab is the volume that the breath adds to the tissue of the slab:
 *
 *     gain = volume after the breath - volume before the breath
 *
 * A slab is bounded by a part of the lung's surface and by cuts along two planes. The basis has no
 * vertices inside the lung. Both before and after the breath, each cut therefore consists of
 * triangles, from the mean point of the outline of the cut to each edge of this outline. The gains
 * of a lung's slabs sum to the gain of the lung. They are exact if displacements are linear in
 * position: 0 for a rotation, and a constant gain / volume for a uniform expansion. Cost: one pass
 * over the triangles for each lung.
 * @param gravity  [3], any length but 0
 * @param from     [N, 3] positions before the breath, mm; NULL for the reference surface
 * @param xyz      [N, 3] positions after the breath (supine_deform), mm
 * @param count    number of slabs, 1 to SUPINE_SLABS_MAX
 * @param slabs    [number of lungs, count], uppermost first, written
 * @retval SUPINE_ERROR_ARGUMENT      gravity is zero or not finite, or the count is out of range
 * @retval SUPINE_ERROR_OPEN_SURFACE  the basis has no volumes */
SUPINE_API supine_status supine_compare_slabs(const supine_basis *basis, const double gravity[3],
                                              const float *from, const float *xyz, size_t count,
                                              supine_slab *slabs, supine_error *error);

#ifdef __cplusplus
}
#endif
#endif
