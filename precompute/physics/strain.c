/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute displacements of tissue whose expandability varies, by least squares over edges. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/vec3.h"

#include "precompute/physics/strain.h"

static const double shortest = 0.5; /* smallest length of an edge, mm, against infinite weights */
static const double hold_length = 1000.0; /* mm; see `hold` */

struct supine_strain {
  size_t vertex_count;
  const supine_topology *topology;
  supine_equilibrium *equilibrium;
  double *weight;        /* [edges] 1 / length, 1/mm */
  double *hold;          /* [vertices] weight that holds the mean displacement only, 1/mm */
  double *expandability; /* [vertices] a, of geometric mean 1 before lesions */
};

void supine_physics_strain_destroy(supine_strain *strain) {
  if (strain != NULL) {
    supine_physics_equilibrium_destroy(strain->equilibrium);
    free(strain->weight);
    free(strain->hold);
    free(strain->expandability);
    free(strain);
  }
}

supine_status supine_physics_strain_create(const supine_lungs *lungs, const double *stiffness,
                                           const double *lesions, supine_strain **strain,
                                           supine_error *error) {
  const size_t n = lungs->mesh.vertex_count;
  const supine_topology *topology = &lungs->topology;
  supine_strain *made = calloc(1, sizeof *made);
  supine_status status = SUPINE_ERROR_MEMORY;
  *strain = NULL;
  if (made != NULL) {
    *made = (supine_strain){.vertex_count = n,
                            .topology = topology,
                            .weight = malloc((topology->edge_count + 1) * sizeof(double)),
                            .hold = calloc(n, sizeof(double)),
                            .expandability = malloc(n * sizeof(double))};
  }
  if (made == NULL || made->weight == NULL || made->hold == NULL || made->expandability == NULL) {
    (void)supine_error_set(error, status, "no memory for the strain of %zu vertices", n);
    goto cleanup;
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
  status = supine_physics_stiffness_normalise(n, stiffness, made->expandability, error);
  for (size_t i = 0; i < n && status == SUPINE_OK; ++i) {
    made->expandability[i] = 1.0 / (made->expandability[i] * (lesions != NULL ? lesions[i] : 1.0));
    made->hold[i] = fmax(made->hold[i], shortest / (hold_length * hold_length));
  }
  if (status == SUPINE_OK) {
    status = supine_physics_equilibrium_create_weighted(topology, n, made->hold, made->weight,
                                                        &made->equilibrium, error);
  }
  if (status == SUPINE_OK) {
    *strain = made;
    made = NULL;
  }
cleanup:
  supine_physics_strain_destroy(made);
  return status;
}

supine_status supine_physics_strain_apply(supine_strain *strain, const double *expandability,
                                          size_t count, double *displacements,
                                          supine_error *error) {
  const double *a = expandability != NULL ? expandability : strain->expandability;
  double *load = malloc(strain->vertex_count * count * sizeof *load);
  if (load == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu displacements",
                            strain->vertex_count * count);
  }
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
  const supine_status status =
      supine_physics_equilibrium_solve(strain->equilibrium, count, load, displacements, error);
  free(load);
  return status;
}
