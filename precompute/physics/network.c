/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Solve for the equilibrium of the network of [Santhanam2008], equations (5), (8) and (12)-(14), by
 * the symmetric matrix of network.h. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"
#include "base/vec3.h"
#include "precompute/physics/factorisation.h"
#include "precompute/physics/network.h"
#include "precompute/physics/stiffness.h"

struct supine_network {
  supine_arena memory; /* of the arrays */
  size_t vertex_count;
  const supine_topology *topology;
  supine_factorisation *factorisation;
  double *distance; /* [edges] distance D of the edge's spring from its two masses, mm */
  double *lesions;  /* [vertices] factors on the normalised stiffness; 1 outside lesions */
  double *weight;   /* [vertices] S, 1 / stiffness */
  double *diagonal; /* [vertices] elements of the matrix */
  double *coupling; /* [edges] c_ij, elements of the matrix times -1 */
};

void supine_physics_network_destroy(supine_network *network) {
  if (network != NULL) {
    supine_physics_factorisation_destroy(network->factorisation);
    supine_arena_free(&network->memory);
    free(network);
  }
}

double supine_physics_link_distance(const double *first, const double *second) {
  return fmax(1.0, 0.5 * supine_distance(first, second));
}

/* Compute the matrix from the weights and distances. */
static void set_matrix(supine_network *network) {
  double *diagonal = network->diagonal;
  const double *s = network->weight;
  for (size_t i = 0; i < network->vertex_count; ++i) {
    diagonal[i] = s[i] * s[i];
  }
  for (size_t e = 0; e < network->topology->edge_count; ++e) {
    const uint32_t i = network->topology->edges[2 * e];
    const uint32_t j = network->topology->edges[2 * e + 1];
    const double d = network->distance[e];
    const double wide = d + 2.0 * s[i] * s[j];
    const double c = s[i] * s[j] / (d * wide);
    diagonal[i] += (s[i] + s[j]) / (2.0 * s[j] * wide);
    diagonal[j] += (s[i] + s[j]) / (2.0 * s[i] * wide);
    diagonal[i] += c;
    diagonal[j] += c;
    network->coupling[e] = c;
  }
  supine_physics_factorisation_set(network->factorisation, diagonal, network->coupling);
}

supine_status supine_physics_network_set_stiffness(supine_network *network, const double *stiffness,
                                                   supine_error *error) {
  SUPINE_TRY(
      supine_physics_stiffness_normalise(network->vertex_count, stiffness, network->weight, error));
  for (size_t i = 0; i < network->vertex_count; ++i) {
    network->weight[i] = 1.0 / (network->weight[i] * network->lesions[i]);
  }
  set_matrix(network);
  return SUPINE_OK;
}

supine_status supine_physics_network_set_shape(supine_network *network, const supine_mesh *mesh,
                                               const double *stiffness, supine_error *error) {
  for (size_t e = 0; e < network->topology->edge_count; ++e) {
    const uint32_t *edge = network->topology->edges + 2 * e;
    network->distance[e] = supine_physics_link_distance(mesh->vertices + 3 * (size_t)edge[0],
                                                        mesh->vertices + 3 * (size_t)edge[1]);
  }
  return supine_physics_network_set_stiffness(network, stiffness, error);
}

supine_status supine_physics_network_create(const supine_mesh *mesh,
                                            const supine_topology *topology, const double *lesions,
                                            supine_network **network, supine_error *error) {
  const size_t n = mesh->vertex_count;
  const size_t edges = topology->edge_count;
  supine_network *made = *network = calloc(1, sizeof *made);
  if (made == NULL) {
    return supine_error_memory(error, "the equilibrium");
  }
  made->vertex_count = n;
  made->topology = topology;
  made->distance = supine_arena_take(&made->memory, edges, sizeof *made->distance);
  made->lesions = supine_arena_take(&made->memory, n, sizeof *made->lesions);
  made->weight = supine_arena_take(&made->memory, n, sizeof *made->weight);
  made->diagonal = supine_arena_take(&made->memory, n, sizeof *made->diagonal);
  made->coupling = supine_arena_take(&made->memory, edges, sizeof *made->coupling);
  SUPINE_TRY(supine_arena_check(&made->memory, error, "the equilibrium of %zu vertices", n));
  for (size_t i = 0; i < n; ++i) {
    made->lesions[i] = lesions != NULL ? lesions[i] : 1.0;
  }
  SUPINE_TRY(supine_physics_factorisation_create(topology, n, &made->factorisation, error));
  return supine_physics_network_set_shape(made, mesh, NULL, error);
}

supine_status supine_physics_network_solve(supine_network *network, size_t count,
                                           const double *force, double *retained,
                                           supine_error *error) {
  SUPINE_TRY(
      supine_physics_factorisation_solve(network->factorisation, count, force, retained, error));
  for (size_t i = 0; i < network->vertex_count; ++i) {
    const double square = network->weight[i] * network->weight[i];
    for (size_t c = 0; c < count; ++c) {
      retained[i * count + c] = square * retained[i * count + c]; /* F_i = S_i^2 t_i */
    }
  }
  return SUPINE_OK;
}

supine_status supine_physics_network_force(supine_network *network, const double *retained,
                                           double *force, supine_error *error) {
  const size_t n = network->vertex_count;
  SUPINE_ARENA arena = {0};
  double *t = supine_arena_take(&arena, n, sizeof *t);
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu vertices", n));
  for (size_t i = 0; i < n; ++i) {
    t[i] = retained[i] / (network->weight[i] * network->weight[i]);
  }
  supine_physics_factorisation_multiply(network->factorisation, t, force);
  return SUPINE_OK;
}
