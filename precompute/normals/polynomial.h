/* SPDX-License-Identifier: GPL-3.0-or-later */
/* A vertex's normal as a quadratic polynomial of the weights. */
#ifndef SUPINE_NORMALS_POLYNOMIAL_H
#define SUPINE_NORMALS_POLYNOMIAL_H

#include "precompute/normals/normals.h"

/* Monomials of K weights: (K + 1)(K + 2) / 2. */
static inline size_t supine_normals_terms(size_t modes) {
  return (modes + 1) * (modes + 2) / 2;
}

/* phi [terms]: q_k q_l, q_0 = 1, q_k = scale w_k. */
void supine_normals_monomials(size_t modes, const double *weights, double scale, double *phi);

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

/* plane [N, 3] += sum over kl of mix_kl A_i,kl of every vertex of a lung. mix [terms]. */
void supine_normals_mix(const supine_normals_surface *surface, size_t lung, const double *mix,
                        float *plane);

#endif
