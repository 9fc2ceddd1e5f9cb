/* SPDX-License-Identifier: GPL-3.0-or-later */
/* From catch to force, and from a function of the catch to its slopes by stiffness. */
#include <stdlib.h>

#include "precompute/physics/inverse.h"
#include "precompute/physics/network.h"

/* One direction of a link without a reach: what passes for each difference of t, what its spring
 * makes the mass of its first end, and the slopes of both by S of either end. */
typedef struct paper_link {
  double c, mass;
  double c_by_give, c_by_other, mass_by_give, mass_by_other;
} paper_link;

static paper_link link_of(double give, double other, double d) {
  const double wide = d + 2.0 * give * other;
  const double half = (give + other) / (2.0 * other);
  return (paper_link){.c = give * other / (d * wide),
                      .mass = half / wide,
                      .c_by_give = other / (wide * wide),
                      .c_by_other = give / (wide * wide),
                      .mass_by_give = 0.5 / (other * wide) - half * 2.0 * other / (wide * wide),
                      .mass_by_other = 0.5 / (other * wide) - half / (other * wide) -
                                       half * 2.0 * give / (wide * wide)};
}

/* S [N] of the file's vertices. */
static supine_status find_give(const supine_network *network, const double *stiffness, double *give,
                               supine_error *error) {
  const supine_status status =
      supine_physics_stiffness_normalise(network->vertex_count, stiffness, give, error);
  for (size_t i = 0; status == SUPINE_OK && i < network->vertex_count; ++i) {
    give[i] = 1.0 / (give[i] * (network->lesions != NULL ? network->lesions[i] : 1.0));
  }
  return status;
}

supine_status supine_physics_inverse_force(const supine_network *network, const double *stiffness,
                                           const double *catch_, double *force,
                                           supine_error *error) {
  const supine_network *net = network;
  double *give = malloc(net->vertex_count * sizeof *give);
  if (give == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu vertices",
                            net->vertex_count);
  }
  const supine_status status = find_give(net, stiffness, give, error);
  for (size_t i = 0; status == SUPINE_OK && i < net->vertex_count; ++i) {
    const uint32_t v = net->order[i];
    const double t = catch_[v] / (give[v] * give[v]);
    const double area = net->area == NULL ? 1.0 : net->area[i];
    double sum = area * catch_[v];
    for (size_t s = net->links.begin[i]; s < net->links.begin[i + 1]; ++s) {
      const uint32_t w = net->order[net->links.column[s]];
      const double other = catch_[w] / (give[w] * give[w]);
      if (net->area != NULL) {
        sum += net->conductance[s] * (t - other);
      } else {
        const paper_link link = link_of(give[v], give[w], net->distance[s]);
        sum += link.c * (t - other) + link.mass * t;
      }
    }
    force[v] = sum / area; /* A t = area f */
  }
  free(give);
  return status;
}

/* Takes lambda . (dA/dS) t of vertex i's links off the slopes by log E: dS = -S dtheta. */
static void add_links(const supine_network *net, size_t i, const double *give, const double *t,
                      const double *adjoint, double *gradient) {
  const uint32_t v = net->order[i];
  for (size_t s = net->links.begin[i]; s < net->links.begin[i + 1]; ++s) {
    const uint32_t w = net->order[net->links.column[s]];
    const paper_link link = link_of(give[v], give[w], net->distance[s]);
    /* Each link is seen from both ends: half of what passes, all of its first end's mass. */
    const double passed = 0.5 * (adjoint[v] - adjoint[w]) * (t[v] - t[w]);
    const double caught = adjoint[v] * t[v];
    gradient[v] += give[v] * (link.c_by_give * passed + link.mass_by_give * caught);
    gradient[w] += give[w] * (link.c_by_other * passed + link.mass_by_other * caught);
  }
}

/* Eight parameters: the system, the two fields that meet in it, and what comes of them. */
supine_status supine_physics_inverse_gradient(const supine_network *network,
                                              supine_equilibrium *equilibrium,
                                              const double *stiffness, const double *catch_,
                                              const double *slope, double tolerance,
                                              double *gradient, supine_error *error) {
  const supine_network *net = network;
  const size_t n = net->vertex_count;
  double *give = malloc(n * sizeof *give);
  double *t = malloc(n * sizeof *t);
  double *adjoint = malloc(n * sizeof *adjoint);
  supine_status status =
      give == NULL || t == NULL || adjoint == NULL
          ? supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu vertices", n)
          : find_give(net, stiffness, give, error);
  if (status == SUPINE_OK) {
    status = supine_physics_equilibrium_set_stiffness(equilibrium, stiffness, error);
  }
  if (status == SUPINE_OK) {
    for (size_t i = 0; i < n; ++i) {
      const uint32_t v = net->order[i];
      const double area = net->area == NULL ? 1.0 : net->area[i];
      t[v] = give[v] * give[v] * slope[v] / area; /* area f = S^2 dJ/dF */
    }
    status =
        supine_physics_equilibrium_solve(equilibrium, 1, t, tolerance, false, adjoint, NULL, error);
  }
  if (status == SUPINE_OK) {
    double mean = 0.0;
    for (size_t i = 0; i < n; ++i) {
      const uint32_t v = net->order[i];
      const double area = net->area == NULL ? 1.0 : net->area[i];
      adjoint[v] /= give[v] * give[v]; /* lambda */
      t[v] = catch_[v] / (give[v] * give[v]);
      gradient[v] = 2.0 * catch_[v] * (area * adjoint[v] - slope[v]);
    }
    for (size_t i = 0; i < n && net->area == NULL; ++i) {
      add_links(net, i, give, t, adjoint, gradient);
    }
    for (size_t i = 0; i < n; ++i) {
      mean += gradient[i] / (double)n;
    }
    for (size_t i = 0; i < n; ++i) {
      gradient[i] -= mean; /* theta has mean 0 */
    }
  }
  free(give);
  free(t);
  free(adjoint);
  return status;
}
