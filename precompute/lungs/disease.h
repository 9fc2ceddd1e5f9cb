/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Diseased lungs ([Santhanam2008] VI): tumours, which stiffen the tissue around them, and collapsed
 * lungs. */
#ifndef SUPINE_DISEASE_H
#define SUPINE_DISEASE_H

#include "precompute/lungs/lungs.h"

/** A region of changed stiffness. The stiffness at distance r from the centre is multiplied by
 *
 *     factor^w     w = 1 for r <= radius/2,  0 for r >= radius,  3 q^2 - 2 q^3 between
 *                  q = 2 (1 - r / radius)
 *
 * so that the stiffness changes smoothly, and not at all beyond the radius. The factors of several
 * lesions multiply. */
typedef struct supine_lesion {
  double centre[3]; /**< mm, LPS; inside the lung or on its surface */
  double radius;    /**< mm, > 0 */
  double factor;    /**< > 0; above 1 stiffer, below 1 softer, 1 changes nothing */
} supine_lesion;

/** Multiply `factors` [N], which start as 1, by the stiffness factors of a lesion. The factors
 * multiply the stiffness after it is scaled to geometric mean 1. In the reverse order, a stiff
 * lesion would soften all other tissue, by 4 % for a lesion of factor 10 over 2 % of the vertices.
 * @param reached  output: number of vertices nearer to the lesion's centre than the radius */
supine_status supine_lungs_add_lesion(const supine_lungs *lungs, const supine_lesion *lesion,
                                      double *factors, size_t *reached, supine_error *error);

/** Compute the surface with collapsed lungs (pneumothorax). lungs->mesh keeps the healthy shape,
 * from which displacements are computed.
 *
 * A collapsed lung is shrunk about its hilum, taken as the mean of the vertices in the quarter of
 * its width nearest the midline. Its lengths and its displacements are multiplied by share^(1/3).
 * So with any gain s (factor on the displacement) and direction g of gravity, lung j has exactly
 * the volume
 *
 *     V_j(s, g) = share x healthy V_j(s, g)
 *
 * @param share     [lungs] volume divided by healthy volume, 0 < share <= 1
 * @param vertices  [N, 3] output, mm */
void supine_lungs_collapse(const supine_lungs *lungs, const double share[2], double *vertices);

/** Estimate the hilum of a lung, mm: the mean of the vertices in the quarter of the lung nearest
 * the midline. supine_lungs_collapse shrinks the lung about this point, which stays where it is. */
void supine_lungs_find_hilum(const supine_lungs *lungs, size_t lung, double hilum[3]);

/** Multiply the displacement directions [N, 3] of each collapsed lung by share^(1/3), in place.
 * `share` is the volume of each lung divided by its healthy volume. */
void supine_lungs_collapse_directions(const supine_lungs *lungs, const double share[2],
                                      double *directions);

#endif
