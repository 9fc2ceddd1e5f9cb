/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute displacements of tissue whose expandability varies, by least squares over edges. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"
#include "base/vec3.h"

#include "precompute/physics/factorisation.h"
#include "precompute/physics/stiffness.h"
#include "precompute/physics/strain.h"

static const double shortest = 0.5; /* smallest length of an edge, mm, against infinite weights */
static const double hold_length = 1000.0; /* mm; see `hold` */

struct supine_strain {
  supine_arena memory;
  size_t vertex_count;
  const supine_topology *topology;
  supine_factorisation *factorisation;
  double *weight;        /* [edges] 1 / length, 1/mm */
  double *hold;          /* [vertices] weight that holds the mean displacement only, 1/mm */
  double *expandability; /* [vertices] a, of geometric mean 1 before lesions */
};

void supine_physics_strain_destroy(supine_strain *strain) {
  if (strain != NULL) {
    supine_physics_factorisation_destroy(strain->factorisation);
    supine_arena_free(&strain->memory);
    free(strain);
  }
}

/* Set the matrix of the least squares: w_ij off the diagonal, times -1; on it, their sum at each
 * vertex plus `hold`. */
static supine_status set_matrix(supine_strain *strain, supine_error *error) {
  SUPINE_ARENA arena = {0};
  double *diagonal = supine_arena_take(&arena, strain->vertex_count, sizeof *diagonal);
  SUPINE_TRY(supine_arena_check(&arena, error, "the strain of %zu vertices", strain->vertex_count));
  memcpy(diagonal, strain->hold, strain->vertex_count * sizeof *diagonal);
  for (size_t e = 0; e < strain->topology->edge_count; ++e) {
    diagonal[strain->topology->edges[2 * e]] += strain->weight[e];
    diagonal[strain->topology->edges[2 * e + 1]] += strain->weight[e];
  }
  supine_physics_factorisation_set(strain->factorisation, diagonal, strain->weight);
  return SUPINE_OK;
}

supine_status supine_physics_strain_create(const supine_lungs *lungs, const double *stiffness,
                                           const double *lesions, supine_strain **strain,
                                           supine_error *error) {
  const size_t n = lungs->mesh.vertex_count;
  const supine_topology *topology = &lungs->topology;
  supine_strain *made = *strain = calloc(1, sizeof *made);
  if (made != NULL) {
    made->vertex_count = n;
    made->topology = topology;
    made->weight = supine_arena_take(&made->memory, topology->edge_count, sizeof(double));
    made->hold = supine_arena_zeros(&made->memory, n, sizeof(double));
    made->expandability = supine_arena_take(&made->memory, n, sizeof(double));
  }
  if (made == NULL || made->memory.failed) {
    return supine_error_memory(error, "the strain of %zu vertices", n);
  }
  for (size_t e = 0; e < topology->edge_count; ++e) {
    const uint32_t *edge = topology->edges + 2 * e;
    const double length = supine_distance(lungs->mesh.vertices + 3 * (size_t)edge[0],
                                          lungs->mesh.vertices + 3 * (size_t)edge[1]);
    made->weight[e] = 1.0 / fmax(length, shortest);
    for (size_t k = 0; k < 2; ++k) {
      made->hold[edge[k]] += fmax(length, shortest) / (hold_length * hold_length);
    }
  }
  SUPINE_TRY(supine_physics_stiffness_normalise(n, stiffness, made->expandability, error));
  SUPINE_TRY(supine_physics_factorisation_create(topology, n, &made->factorisation, error));
  for (size_t i = 0; i < n; ++i) {
    made->expandability[i] = 1.0 / (made->expandability[i] * (lesions != NULL ? lesions[i] : 1.0));
    made->hold[i] = fmax(made->hold[i], shortest / (hold_length * hold_length));
  }
  return set_matrix(made, error);
}

supine_status supine_physics_strain_apply(supine_strain *strain, const double *expandability,
                                          size_t count, double *displacements,
                                          supine_error *error) {
  const double *a = expandability != NULL ? expandability : strain->expandability;
  SUPINE_ARENA arena = {0};
  double *load = supine_arena_take(&arena, strain->vertex_count * count, sizeof *load);
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu displacements", strain->vertex_count * count));
  for (size_t i = 0; i < strain->vertex_count * count; ++i) {
    load[i] = strain->hold[i / count] * displacements[i];
  }
  for (size_t e = 0; e < strain->topology->edge_count; ++e) {
    const size_t i = strain->topology->edges[2 * e];
    const size_t j = strain->topology->edges[2 * e + 1];
    const double factor = strain->weight[e] * 0.5 * (a[i] + a[j]);
    for (size_t c = 0; c < count; ++c) {
      const double part = factor * (displacements[i * count + c] - displacements[j * count + c]);
      load[i * count + c] += part;
      load[j * count + c] -= part;
    }
  }
  return supine_physics_factorisation_solve(strain->factorisation, count, load, displacements,
                                            error);
}
