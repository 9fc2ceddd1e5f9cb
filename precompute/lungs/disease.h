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

/** Return whether a point of the surface of a lung, as it was scanned, belongs to its hilum: the
 * first 0.35 of the box around the lung from the midline, in the middle 0.4 of the box along y and
 * z. This is the only definition of the hilum.
 * @param p     the point in the scan, mm
 * @param low   lowest corner of the box around the lung, mm
 * @param high  highest corner
 * @param left  whether it is the left lung */
bool supine_lungs_is_hilar(const double *p, const double low[3], const double high[3], bool left);

/** Compute the mean of vectors [N, 3] over the vertices of the hilum of a lung. If a coarse surface
 * has no vertex there, use the first vertex of the lung. */
void supine_lungs_hilum_mean(const supine_lungs *lungs, size_t lung, const double *values,
                             double mean[3]);

/** Compute the positions, or the displacements, of collapsed lungs (pneumothorax) from those of
 * healthy lungs in the same state. lungs->mesh keeps the healthy shape.
 *
 *     x' = h + c^(1/3) (x - h)     with h the mean of x over the hilum
 *
 * Applied to positions, this shrinks a lung about its hilum. It is linear: applied to displacements,
 * it gives those by which the collapsed lung moves about the moving hilum, which stays where it is
 * in healthy lungs. In each state, the volume of lung j is
 *
 *     V_j = c x healthy V_j
 *
 * @param share      [lungs] c, volume divided by healthy volume, 0 < c <= 1
 * @param values     [N, 3] positions or displacements of healthy lungs, mm
 * @param collapsed  [N, 3] output, mm; may be `values` */
void supine_lungs_collapse(const supine_lungs *lungs, const double share[2], const double *values,
                           double *collapsed);

#endif
