/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Links whose spreading has a length in mm: what supine_physics_model_network makes of the reach.
 */
#include <math.h>
#include <stdlib.h>

#include "precompute/physics/model.h"
#include "precompute/physics/network.h"

/* Slot of the link from internal vertex i to j. */
static size_t find_link(const supine_network *network, size_t i, size_t j) {
  size_t s = network->links.begin[i];
  while (network->links.column[s] != j) {
    ++s;
  }
  return s;
}

static double squared_length(const supine_mesh *mesh, uint32_t a, uint32_t b) {
  double sum = 0.0;
  for (size_t k = 0; k < 3; ++k) {
    const double step = mesh->vertices[3 * (size_t)a + k] - mesh->vertices[3 * (size_t)b + k];
    sum += step * step;
  }
  return sum;
}

static double triangle_area(const supine_mesh *mesh, size_t t) {
  const double *p[3];
  for (size_t k = 0; k < 3; ++k) {
    p[k] = mesh->vertices + 3 * (size_t)mesh->triangles[3 * t + k];
  }
  double square = 0.0;
  for (size_t k = 0; k < 3; ++k) {
    const size_t a = (k + 1) % 3;
    const size_t b = (k + 2) % 3;
    const double x =
        (p[1][a] - p[0][a]) * (p[2][b] - p[0][b]) - (p[1][b] - p[0][b]) * (p[2][a] - p[0][a]);
    square += x * x;
  }
  return 0.5 * sqrt(square);
}

/* Give the links and masses the weights of a spreading length in mm, and coarsen the graph.
 *
 * The system of equilibrium.h with a reach is (1 - R^2 Laplacian) F = a f in the weak form on the
 * surface, where area_i is
 * the vertex's area A_i over the mean area A and w = 2 R^2 c / A, with link coefficients c that
 * make sum of c (F_i - F_j)^2 the Dirichlet integral of |grad F|^2. Of a link's own area a (a third
 * of its triangles') and length h, c = 2 a / h^2 does so for links that run in all directions
 * alike; unlike cotangents it is never negative, whatever the triangles, at the price of R^2 within
 * a tenth or so. */
static supine_status set_reach(supine_network *network, const supine_mesh *mesh,
                               const supine_topology *topology, double reach) {
  const size_t n = network->vertex_count;
  double *area = malloc(n * sizeof *area);
  const size_t links = network->links.begin[n];
  double *link = calloc(links + 1, sizeof *link); /* its area, then its conductance */
  network->area = malloc(n * sizeof *network->area);
  network->conductance = link;
  network->links.value = malloc((links + 1) * sizeof *network->links.value);
  if (area == NULL || link == NULL || network->area == NULL || network->links.value == NULL) {
    free(area);
    return SUPINE_ERROR_MEMORY; /* the rest goes with the network */
  }
  supine_mesh_vertex_area(mesh, area);
  double mean = 0.0;
  for (size_t i = 0; i < n; ++i) {
    mean += area[i] / (double)n;
  }
  /* A vertex or link of no area must still hold on to something. */
  const double least = 1e-6 * mean;
  for (size_t i = 0; i < n; ++i) {
    network->area[i] = fmax(area[network->order[i]], least) / mean;
  }
  for (size_t t = 0; t < mesh->triangle_count; ++t) {
    const uint32_t *corner = mesh->triangles + 3 * t;
    const double third = triangle_area(mesh, t) / 3.0;
    for (size_t k = 0; k < 3; ++k) {
      const size_t i = network->rank[corner[k]];
      const size_t j = network->rank[corner[(k + 1) % 3]];
      link[find_link(network, i, j)] += third;
      link[find_link(network, j, i)] += third;
    }
  }
  for (size_t e = 0; e < topology->edge_count; ++e) {
    const uint32_t *edge = topology->edges + 2 * e;
    const size_t i = network->rank[edge[0]];
    const size_t j = network->rank[edge[1]];
    const size_t s = find_link(network, i, j);
    const double a = link[s] > least ? link[s] : least;
    const double h2 = squared_length(mesh, edge[0], edge[1]);
    const double weight = 2.0 * reach * reach / mean * 2.0 * a / (h2 > least ? h2 : least);
    link[s] = link[find_link(network, j, i)] = 0.5 * weight;
  }
  for (size_t s = 0; s < links; ++s) {
    network->links.value[s] = (float)link[s];
  }
  free(area);
  return supine_physics_hierarchy_create(&network->links, &network->coarse);
}

supine_status supine_physics_model_network(const supine_lungs *lungs, const supine_model *model,
                                           supine_network **network) {
  supine_network *made = NULL;
  *network = NULL;
  supine_status status = supine_physics_network_create(&lungs->mesh, &lungs->topology, &made);
  if (status == SUPINE_OK && model->reach > 0.0) {
    /* From the size of the lungs on forces are even all over, and the matrix next to singular. */
    double square = 0.0;
    for (size_t k = 0; k < 3; ++k) {
      const double half = 0.5 * (lungs->maximum[k] - lungs->minimum[k]);
      square += half * half;
    }
    status = set_reach(made, &lungs->mesh, &lungs->topology, fmin(model->reach, sqrt(square)));
  }
  if (status == SUPINE_OK && model->lesions != NULL) {
    made->lesions = malloc(made->vertex_count * sizeof *made->lesions);
    status = made->lesions == NULL ? SUPINE_ERROR_MEMORY : SUPINE_OK;
    for (size_t i = 0; i < made->vertex_count && status == SUPINE_OK; ++i) {
      made->lesions[i] = model->lesions[i];
    }
  }
  if (status != SUPINE_OK) {
    supine_physics_network_destroy(made);
    return status;
  }
  *network = made;
  return SUPINE_OK;
}
