/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Choose between the network and the smoothing. */
#include <stdlib.h>

#include "base/arena.h"
#include "precompute/physics/equilibrium.h"
#include "precompute/physics/network.h"
#include "precompute/physics/smoothing.h"

typedef enum kind { NETWORK, SMOOTHING } kind;

struct supine_equilibrium {
  kind kind;
  size_t vertex_count;
  supine_network *network;     /* if `kind` is NETWORK */
  supine_smoothing *smoothing; /* if `kind` is SMOOTHING */
};

void supine_physics_equilibrium_destroy(supine_equilibrium *equilibrium) {
  if (equilibrium != NULL) {
    supine_physics_network_destroy(equilibrium->network);
    supine_physics_smoothing_destroy(equilibrium->smoothing);
    free(equilibrium);
  }
}

supine_status supine_physics_equilibrium_create(const supine_mesh *mesh,
                                                const supine_topology *topology, double reach,
                                                const double *lesions,
                                                supine_equilibrium **equilibrium,
                                                supine_error *error) {
  supine_equilibrium *made = *equilibrium = calloc(1, sizeof *made);
  if (made == NULL) {
    return supine_error_memory(error, "the equilibrium");
  }
  made->vertex_count = mesh->vertex_count;
  supine_status status;
  if (reach > 0.0) {
    made->kind = SMOOTHING;
    status = supine_physics_smoothing_create(mesh, topology, reach, &made->smoothing, error);
  } else {
    made->kind = NETWORK;
    status = supine_physics_network_create(mesh, topology, lesions, &made->network, error);
  }
  if (status != SUPINE_OK) {
    supine_physics_equilibrium_destroy(made);
    *equilibrium = NULL;
  }
  return status;
}

supine_status supine_physics_equilibrium_set_stiffness(supine_equilibrium *equilibrium,
                                                       const double *stiffness,
                                                       supine_error *error) {
  if (equilibrium->kind == NETWORK) {
    return supine_physics_network_set_stiffness(equilibrium->network, stiffness, error);
  }
  return SUPINE_OK;
}

supine_status supine_physics_equilibrium_set_shape(supine_equilibrium *equilibrium,
                                                   const supine_mesh *mesh, double reach,
                                                   const double *stiffness, supine_error *error) {
  if (equilibrium->kind == NETWORK) {
    return supine_physics_network_set_shape(equilibrium->network, mesh, stiffness, error);
  }
  supine_physics_smoothing_set_shape(equilibrium->smoothing, mesh, reach);
  return SUPINE_OK;
}

supine_status supine_physics_equilibrium_solve(supine_equilibrium *equilibrium, size_t count,
                                               const double *force, double *retained,
                                               supine_error *error) {
  if (equilibrium->kind == NETWORK) {
    return supine_physics_network_solve(equilibrium->network, count, force, retained, error);
  }
  return supine_physics_smoothing_solve(equilibrium->smoothing, count, force, retained, error);
}

supine_status supine_physics_equilibrium_force(supine_equilibrium *equilibrium,
                                               const double *retained, double *force,
                                               supine_error *error) {
  if (equilibrium->kind == NETWORK) {
    return supine_physics_network_force(equilibrium->network, retained, force, error);
  }
  supine_physics_smoothing_force(equilibrium->smoothing, retained, force);
  return SUPINE_OK;
}

supine_status supine_physics_transfer_column(supine_equilibrium *equilibrium, size_t vertex,
                                             double *column, supine_error *error) {
  const size_t n = equilibrium->vertex_count;
  SUPINE_REFUSE_IF(vertex >= n, error, SUPINE_ERROR_ARGUMENT,
                   "vertex %zu is out of range: the mesh has %zu vertices, counted from 0", vertex,
                   n);
  SUPINE_ARENA arena = {0};
  double *force = supine_arena_zeros(&arena, n, sizeof *force);
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu forces", n));
  force[vertex] = 1.0;
  return supine_physics_equilibrium_solve(equilibrium, 1, force, column, error);
}
