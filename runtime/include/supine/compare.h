/* SPDX-License-Identifier: MIT */
/** @file
 * Comparing orientations: distances between deformed lungs, and who ventilates where.
 *
 * Averages are over the rest surface's area: vertex i counts with a_i, a third of its triangles'
 * area, over the sum of all. A deformed state is K weights (supine_basis_weights) and a breath
 * scale for each lung [G]. */
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

/** Makes it: the Gram matrix of each lung, by one pass over the vertices,
 *
 *     G_kl = sum over i of a_i |d_i|^2 c_ik c_il       (vector fields: the sum of three components)
 *
 * @param basis  must outlive the comparison
 * Cost: N K^2 / 2 multiplications.
 * @retval SUPINE_ERROR_MESH    the surface has no area
 * @retval SUPINE_ERROR_MEMORY */
SUPINE_API supine_status supine_compare_create(const supine_basis *basis, supine_compare **compare,
                                               supine_error *error);
/** Releases it; NULL is legal. */
SUPINE_API void supine_compare_destroy(supine_compare *compare);

/** Area of the rest surface, mm^2. */
SUPINE_API double supine_compare_area(const supine_compare *compare);

/** How far the lungs breathe, whichever way gravity points. */
typedef enum supine_inflation_kind {
  SUPINE_INFLATION_VOLUME = 0, /**< mL that the lungs together hold beyond the file's surface */
  SUPINE_INFLATION_RMS,        /**< RMS displacement, mm: for open surfaces */
  SUPINE_INFLATION_SCALE,      /**< one breath scale */
  SUPINE_INFLATION_REST        /**< mL beyond the posture's resting volume */
} supine_inflation_kind;

typedef struct supine_inflation {
  supine_inflation_kind kind;
  double amount;
} supine_inflation;

/** The breath scale, one for all lungs, that inflates by that much. No pass over the vertices.
 * @param gravity  [3] that the weights are of
 * @retval SUPINE_ERROR_ARGUMENT      gravity is zero or not finite, where rest depends on it
 * @retval SUPINE_ERROR_OPEN_SURFACE  a volume of an open surface
 * @retval SUPINE_ERROR_NUMERICAL     no scale reaches it, or nothing moves */
SUPINE_API supine_status supine_compare_scale(const supine_compare *compare,
                                              const supine_inflation *inflation,
                                              const double gravity[3], const double *weights,
                                              double *scale, supine_error *error);

/** RMS distance between two states, mm, from the Gram matrices alone:
 *
 *     d^2 = sum over lungs of q^T G q,     q = s_a w_a - s_b w_b
 *
 * @param weights_b, scales_b  NULL: the rest surface
 * Cost: G K^2 multiplications, no pass over the vertices. */
SUPINE_API double supine_compare_rms(const supine_compare *compare, const double *weights_a,
                                     const double *scales_a, const double *weights_b,
                                     const double *scales_b);

/** Distance of every vertex between two states, mm.
 * @param weights_b, scales_b  NULL: the rest surface
 * @param distance  [N], written
 * Cost: one pass, K + 1 multiplications per vertex (vector fields: 3 K + 3). */
SUPINE_API void supine_compare_distances(const supine_compare *compare, const double *weights_a,
                                         const double *scales_a, const double *weights_b,
                                         const double *scales_b, float *distance);

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

/** Squared displacement at breath scale 1, averaged over area and over all directions of gravity,
 * that the harmonics of each band carry, mm^2:
 *
 *     energy[l] = 1 / (4 pi) * sum over m of  M_lm^T G M_lm       M_lm: column lm of `modes`
 *
 * Odd bands change sign with gravity, even ones do not.
 * @param energy  [L + 1], written */
SUPINE_API void supine_compare_energy(const supine_compare *compare, double *energy);

/** Directions that differ most, at one inflation. */
typedef struct supine_extremes {
  size_t directions;  /**< sampled that reach the inflation */
  double pair[2][3];  /**< the two directions of gravity that differ most, unit */
  double pair_rms;    /**< RMS distance between them, mm */
  double farthest[3]; /**< the direction that differs most from the given one, unit */
  double farthest_rms;
} supine_extremes;

/** Searches the sphere. Compares a golden-angle spiral of directions with each other and with
 * `from`, each to each, then moves the best ones along the sphere, by steps that halve from the
 * spiral's spacing to 1e-6 rad, while that raises the distance. A maximum whose whole summit is
 * narrower than the spacing, 3.5 / sqrt(directions) rad, can be missed. Directions in which the
 * lungs cannot reach the inflation do not take part.
 *
 * @param from        [3], any length but 0
 * @param directions  of the spiral, 2 to 16384; 2048 are 4.5 degrees apart
 * Cost: K directions^2 / 2 multiplications; allocates 2 K directions numbers meanwhile.
 * @retval SUPINE_ERROR_ARGUMENT   directions out of range, or `from` is zero or not finite
 * @retval SUPINE_ERROR_NUMERICAL  `from`, or all but one, cannot reach the inflation
 * @retval SUPINE_ERROR_OPEN_SURFACE, SUPINE_ERROR_MEMORY */
SUPINE_API supine_status supine_compare_search(const supine_compare *compare,
                                               const supine_inflation *inflation,
                                               const double from[3], size_t directions,
                                               supine_extremes *extremes, supine_error *error);

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
