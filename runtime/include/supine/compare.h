/* SPDX-License-Identifier: MIT */
/** @file
 * Comparing orientations: distances between deformed lungs, and who ventilates where.
 *
 * Averages are over the rest surface's area: vertex i counts with a_i, a third of its triangles'
 * area, over the sum of all. A deformed state is a supine_pose. */
#ifndef SUPINE_COMPARE_H
#define SUPINE_COMPARE_H

#include <stddef.h>

#include <supine/runtime.h>
#include <supine/status.h>

#ifdef __cplusplus
extern "C" {
#endif

/** What comparisons of one basis need: areas and Gram matrices. Nothing changes it, so that any
 * number of threads may use one. */
typedef struct supine_compare supine_compare;

/** Makes it: the Gram matrix of each lung and axis j, by one pass over the vertices,
 *
 *     G_j,kl = sum over i of a_i d_ij^2 c_ik c_il       (vector fields: a_i c_ijk c_ijl)
 *
 * @param basis  must outlive the comparison
 * Cost: 3 N K^2 / 2 multiplications.
 * @retval SUPINE_ERROR_MESH    the surface has no area
 * @retval SUPINE_ERROR_MEMORY */
SUPINE_API supine_status supine_compare_create(const supine_basis *basis, supine_compare **compare,
                                               supine_error *error);
/** Releases it; NULL is legal. */
SUPINE_API void supine_compare_destroy(supine_compare *compare);

/** Area of the rest surface, mm^2. */
SUPINE_API double supine_compare_area(const supine_compare *compare);

/** supine_basis_pose or, where `rms` is above 0, the gain at which the RMS displacement is that,
 * mm: for open surfaces.
 * @retval as supine_basis_pose; SUPINE_ERROR_NUMERICAL also where nothing moves */
SUPINE_API supine_status supine_compare_pose(const supine_compare *compare,
                                             const supine_state *state, double rms,
                                             supine_pose *pose, supine_error *error);

/** RMS distance between two poses, mm, from the Gram matrices alone:
 *
 *     d^2 = sum over lungs and axes of q^T G q,     q = A w - A' w'
 *
 * @param from  NULL: the reference surface
 * Cost: 3 G K^2 multiplications, no pass over the vertices. */
SUPINE_API double supine_compare_rms(const supine_compare *compare, const supine_pose *pose,
                                     const supine_pose *from);

/** Distance of every vertex between two poses, mm.
 * @param from      NULL: the reference surface
 * @param distance  [N], written
 * Cost: one pass, 3 K + 6 multiplications per vertex. */
SUPINE_API void supine_compare_distances(const supine_compare *compare, const supine_pose *pose,
                                         const supine_pose *from, float *distance);

/** How distances are spread over the surface, mm. */
typedef struct supine_distance_statistics {
  double mean; /**< area-weighted */
  double rms;  /**< area-weighted */
  double p95;  /**< the smallest distance that at least 95 % of the area does not exceed */
  double max;  /**< of any vertex */
} supine_distance_statistics;

/** Statistics of distances [N], none negative. Exact, by four passes, without allocation. */
SUPINE_API void supine_compare_statistics(const supine_compare *compare, const float *distance,
                                          supine_distance_statistics *statistics);

/** Squared displacement at gain 1, averaged over area and over all directions of gravity,
 * that the harmonics of each band carry, mm^2:
 *
 *     energy[l] = 1 / (4 pi) * sum over m of  M_lm^T G M_lm       M_lm: column lm of `modes`
 *
 * Odd bands change sign with gravity, even ones do not.
 * @param energy  [L + 1], written */
SUPINE_API void supine_compare_energy(const supine_compare *compare, double *energy);

/** Directions that differ most, at one volume. */
typedef struct supine_extremes {
  size_t directions;  /**< sampled in which the lungs reach the volume */
  double pair[2][3];  /**< the two directions of gravity that differ most, unit */
  double pair_rms;    /**< RMS distance between them, mm */
  double farthest[3]; /**< the direction that differs most from the given one, unit */
  double farthest_rms;
} supine_extremes;

/** Searches the sphere. Compares a golden-angle spiral of directions with each other and with
 * `from`, each to each, then moves the best ones along the sphere, by steps that halve from the
 * spiral's spacing to 1e-6 rad, while that raises the distance. A maximum whose whole summit is
 * narrower than the spacing, 3.5 / sqrt(directions) rad, can be missed. Directions in which the
 * lungs cannot reach the volume do not take part.
 *
 * @param from        posture and volume; the volume is that of every direction
 * @param rms         mm, see supine_compare_pose
 * @param directions  of the spiral, 2 to 16384; 2048 are 4.5 degrees apart
 * Cost: 3 G K directions^2 / 2 multiplications; allocates 6 G K directions numbers meanwhile.
 * @retval SUPINE_ERROR_ARGUMENT   directions out of range, or `from` is zero or not finite
 * @retval SUPINE_ERROR_NUMERICAL  `from`, or all but one, cannot reach the volume
 * @retval SUPINE_ERROR_OPEN_SURFACE, SUPINE_ERROR_MEMORY */
SUPINE_API supine_status supine_compare_search(const supine_compare *compare,
                                               const supine_state *from, double rms,
                                               size_t directions, supine_extremes *extremes,
                                               supine_error *error);

/** The tissue of one lung between two heights. */
typedef struct supine_slab {
  double volume; /**< before the breath, mL */
  double gain;   /**< mL that it gains; over `volume`, its regional expansion */
} supine_slab;

/** Most slabs. */
enum { SUPINE_SLABS_MAX = 64 };

/** Ventilation by height: cuts the surface before a breath into slabs of equal thickness across
 * gravity, the lungs' common lowest and highest points its ends, and finds what the tissue in each
 * gains.
 *
 *     gain = volume that the slab's part of the surface sweeps
 *            + A mean(u.g) of its lower cut - A mean(u.g) of its upper cut
 *
 * The sweep of each triangle is exact, so that a lung's slabs sum to the volume that it gains. A
 * cut inside the lung has no vertices: its area A is exact, and its mean displacement along gravity
 * is that of the plane fitted (least squares) to u.g along the cut's outline, at the cut's
 * centroid. This is exact for translations, and to first order for every displacement that is
 * linear in position: a turning lung does not ventilate, one that swells evenly expands by the same
 * share everywhere.
 *
 * @param gravity  [3], any length but 0
 * @param from     [N, 3] positions before the breath; NULL: the file's surface
 * @param xyz      [N, 3] positions after it (supine_deform)
 * @param count    1 to SUPINE_SLABS_MAX
 * @param slabs    [G, count], uppermost first, written
 * Cost: one pass over the triangles.
 * @retval SUPINE_ERROR_ARGUMENT      no direction, or a count out of range
 * @retval SUPINE_ERROR_OPEN_SURFACE  the basis has no volumes */
SUPINE_API supine_status supine_compare_slabs(const supine_basis *basis, const double gravity[3],
                                              const float *from, const float *xyz, size_t count,
                                              supine_slab *slabs, supine_error *error);

#ifdef __cplusplus
}
#endif
#endif
