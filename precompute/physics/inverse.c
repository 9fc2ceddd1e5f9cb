/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Find the applied force from the catch. */
#include <stdlib.h>

#include "precompute/physics/inverse.h"
#include "precompute/physics/network.h"

/* f of vertex i without a reach: its catch, the flow over its links and the catch of their
 * springs. give [N]: S, file's order. */
static double paper_force(const supine_network *net, const double *give, const double *catch_,
                          size_t i) {
  const uint32_t v = net->order[i];
  const double t = catch_[v] / (give[v] * give[v]);
  double sum = catch_[v];
  for (size_t s = net->links.begin[i]; s < net->links.begin[i + 1]; ++s) {
    const uint32_t w = net->order[net->links.column[s]];
    const double d = net->distance[s];
    const double wide = d + 2.0 * give[v] * give[w];
    sum += give[v] * give[w] / (d * wide) * (t - catch_[w] / (give[w] * give[w]));
    sum += (give[v] + give[w]) / (2.0 * give[w] * wide) * t;
  }
  return sum;
}

/* The same with a reach: (area + L) F / (area a). */
static double reach_force(const supine_network *net, const double *give, const double *catch_,
                          size_t i) {
  const uint32_t v = net->order[i];
  double sum = net->area[i] * catch_[v];
  for (size_t s = net->links.begin[i]; s < net->links.begin[i + 1]; ++s) {
    sum += net->conductance[s] * (catch_[v] - catch_[net->order[net->links.column[s]]]);
  }
  return sum / (net->area[i] * give[v]);
}

supine_status supine_physics_inverse_force(const supine_network *network, const double *stiffness,
                                           const double *catch_, double *force,
                                           supine_error *error) {
  const size_t n = network->vertex_count;
  double *give = malloc(n * sizeof *give);
  if (give == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu vertices", n);
  }
  const supine_status status = supine_physics_stiffness_normalise(n, stiffness, give, error);
  for (size_t i = 0; status == SUPINE_OK && i < n; ++i) {
    give[i] = 1.0 / (give[i] * (network->lesions != NULL ? network->lesions[i] : 1.0));
  }
  for (size_t i = 0; status == SUPINE_OK && i < n; ++i) {
    force[network->order[i]] =
        (network->area == NULL ? paper_force : reach_force)(network, give, catch_, i);
  }
  free(give);
  return status;
}
