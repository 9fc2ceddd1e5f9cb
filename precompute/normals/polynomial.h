/* SPDX-License-Identifier: GPL-3.0-or-later */
/* A vertex's normal as a polynomial of the weights and the three gains. */
#ifndef SUPINE_NORMALS_POLYNOMIAL_H
#define SUPINE_NORMALS_POLYNOMIAL_H

#include "precompute/normals/normals.h"

/* Monomials of K weights in one component of a normal, along axis c:
 *
 *     1, a w_k, b w_k, a b w_k w_l (k <= l)     a, b: gains of the next two axes, cyclically */
static inline size_t supine_normals_terms(size_t modes) {
  return 1 + 2 * modes + modes * (modes + 1) / 2;
}

/* phi [3, terms]: the monomials of the components x, y and z. */
void supine_normals_monomials(size_t modes, const double *weights, const double gains[3],
                              double *phi);

/* Some vertices of one lung, and their polynomials. */
typedef struct supine_normals_rows {
  size_t count;     /* R */
  uint32_t *vertex; /* [R] */
  double *terms;    /* [R, 3, terms] A_i / |N_i(0)| */
} supine_normals_rows;

/* Every `stride`-th vertex of a lung from `begin` + `offset` on; those that have no normal at rest
 * are left out.
 * SUPINE_ERROR_MEMORY */
supine_status supine_normals_rows_create(const supine_normals_surface *surface, size_t lung,
                                         size_t offset, size_t stride, supine_normals_rows *rows);
void supine_normals_rows_free(supine_normals_rows *rows);

/* plane [N, 3] += sum over t of mix_ct A_i,ct, c = x, y, z, of every vertex of a lung. mix [3,
 * terms].
 */
void supine_normals_mix(const supine_normals_surface *surface, size_t lung, const double *mix,
                        float *plane);

#endif
