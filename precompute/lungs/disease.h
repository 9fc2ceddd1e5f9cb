/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Diseased lungs ([Santhanam2008] VI): tumours that stiffen what is around them, and collapse.
 *
 * Both are written down in the model (model.h): as factors on the stiffness, and as shares.
 */
#ifndef SUPINE_DISEASE_H
#define SUPINE_DISEASE_H

#include "precompute/lungs/lungs.h"

/** A region of changed stiffness. With r the distance to its centre, E is multiplied by
 *
 *     factor^w     w = 1 for r <= radius/2,  0 for r >= radius,  3 q^2 - 2 q^3 between
 *                  q = 2 (1 - r / radius)
 *
 * so that it is `factor` inside, exactly 1 from the radius on, and smooth. Several multiply. */
typedef struct supine_lesion {
  double centre[3]; /**< mm, LPS; inside the lung or on its surface */
  double radius;    /**< mm, > 0 */
  double factor;    /**< > 0; above 1 stiffer, below 1 softer, 1 changes nothing */
} supine_lesion;

/** Multiplies a lesion into `factors` [N], which start as 1 everywhere. It acts after stiffness was
 * scaled to geometric mean 1: scaling with the lesion in it would soften all other tissue, by 4 %
 * for a lesion of factor 10 over 2 % of the vertices, however far away. So at one breath scale
 * tissue away from the lesion moves as before; at one volume it also takes, everywhere in the same
 * proportion, what the lesion no longer does.
 *
 * @param reached  optional: how many vertices are nearer than the radius; 0: it changes nothing
 * @retval SUPINE_ERROR_ARGUMENT  a centre that is not finite, a radius or factor that is not
 *                                positive and finite
 */
supine_status supine_tissue_add_lesion(const supine_lungs *lungs, const supine_lesion *lesion,
                                       double *factors, size_t *reached, supine_error *error);

/** Collapses a lung (pneumothorax) to a share of its volume and of its breath.
 *
 * The lung is drawn together about its hilum, the mean of the vertices in the quarter of its width
 * that is nearest the midline, as a similar body: lengths, and displacements with them, by
 * k = share^(1/3), after the field was solved on the healthy shape. So at any breath scale s
 *
 *     rest volume = share x healthy      V_j(s, g) = share x healthy V_j(s, g)
 *
 * exactly, for every direction of gravity, and a breath of V mL that both lungs draw at one scale
 * is divided as share V_sick(s) : V_healthy(s) without any word to the run-time library.
 *
 * @param lung   0 to lung_count - 1
 * @param share  0 < share <= 1; 1 changes nothing
 * @retval SUPINE_ERROR_ARGUMENT */
supine_status supine_tissue_collapse(const supine_lungs *lungs, size_t lung, double share,
                                     double shares[2], supine_error *error);

/** The surface at rest, [N, 3] mm: the healthy lungs' with collapsed ones drawn together. `mesh` of
 * the lungs itself keeps the healthy shape, which forces, heights and links are taken from. */
void supine_tissue_rest(const supine_lungs *lungs, const double share[2], double *vertices);

/** Turns directions d [N, 3] of the healthy shape into those of the surface at rest, in place. */
void supine_tissue_rest_directions(const supine_lungs *lungs, const double share[2],
                                   double *directions);

#endif
