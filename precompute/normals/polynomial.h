/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Express the normal of a vertex as a polynomial of the weights and gains of the displacement
 * (normal_modes.h), and sample the states in which modes of the normals are found and measured. */
#ifndef SUPINE_NORMALS_POLYNOMIAL_H
#define SUPINE_NORMALS_POLYNOMIAL_H

#include "precompute/normals/normal_modes.h"

/* Return the number of monomials in the component of a normal along one axis. Let w_k be the
 * weights of the displacement modes, and let a and b be the gains (factors on the displacement) of
 * the next two axes in cyclic order. The monomials are
 *
 *     1, a w_k, b w_k, a b w_k w_l for k <= l */
static inline size_t supine_normals_terms(size_t modes) {
  return 1 + 2 * modes + modes * (modes + 1) / 2;
}

/* Compute the monomials of weights and gains (supine_normals_terms) into phi [axis, monomial]. */
void supine_normals_monomials(size_t modes, const double *weights, const double gains[3],
                              double *phi);

/* The triangles around each vertex. Vertex i stands at the indices corner[begin[i]], ...,
 * corner[begin[i + 1] - 1] in the array `triangles` of the surface. */
typedef struct supine_normals_fans {
  uint32_t *begin;  /* [N + 2] begin[i]: where vertex i starts in `corner`; last: work space */
  uint32_t *corner; /* [3 x triangle count] indices into the array `triangles`, grouped by vertex */
} supine_normals_fans;

/* Find the triangles around each vertex. */
supine_status supine_normals_fans_create(const supine_normals_surface *surface, supine_arena *arena,
                                         supine_normals_fans *fans);

/* Find the other two corners of the triangle that contains element `corner` of `triangles`, in the
 * cyclic order of that triangle. */
static inline void supine_normals_fan_others(const uint32_t *triangles, uint32_t corner,
                                             uint32_t others[2]) {
  const uint32_t v = corner % 3;
  others[0] = triangles[corner - v + (v + 1) % 3];
  others[1] = triangles[corner - v + (v + 2) % 3];
}

/* Polynomials (normal_modes.h) that give the normals of some vertices of one lung. */
typedef struct supine_normals_rows {
  size_t count;     /* number of vertices */
  uint32_t *vertex; /* [count] indices of the vertices */
  double *terms;    /* [count, 3, monomials] coefficients A_ic (normal_modes.h), divided by the
                       length of the normal on the reference surface */
} supine_normals_rows;

/* Find the polynomials for the normals of every `stride`-th vertex of a lung. The first of these
 * vertices is `offset`, counted from the first vertex of the lung. Leave out vertices whose normal
 * on the reference surface is zero. */
supine_status supine_normals_rows_create(const supine_normals_surface *surface,
                                         const supine_normals_fans *fans, size_t lung,
                                         size_t offset, size_t stride, supine_arena *arena,
                                         supine_normals_rows *rows);

/* Sampled states (postures with a volume) of the lungs. */
typedef struct supine_normals_states {
  size_t count;    /* number of sampled states, at most `room` */
  size_t room;     /* requested number of states */
  double *phi;     /* [lungs, requested states, 3, monomials] of supine_normals_monomials() */
  double range[2]; /* extreme changes of volume, mL; if FRC is unknown, displacements, mm */
} supine_normals_states;

/* Sample up to `count` states with directions of gravity all over the sphere and volumes from rest
 * (FRC) to the reference surface. If the resting volume is unknown, the displacement of the vertex
 * that moves most ranges from -15 to 60 mm; negative values reverse all displacements. States that
 * the lungs cannot reach are left out. A different `shift`, 0 to 1, gives different states. */
supine_status supine_normals_states_create(const supine_normals_surface *surface, size_t count,
                                           double shift, supine_arena *arena,
                                           supine_normals_states *states);

#endif
