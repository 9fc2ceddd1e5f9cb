/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Choose whether a basis of another simulator's fields stores modes or clusters. */
#include <math.h>

#include "base/arena.h"
#include "precompute/fields/storage.h"

/* Largest error of clusters: together with that of the fit, 1.5 times the latter, sqrt(1.5^2 - 1);
 * and a distance, mm. */
static const double beside_fit = 1.118;
static const double largest_mm = 0.2;

/* Largest jump of the error along an edge between clusters, divided by the mean edge. */
static const double largest_seam = 0.01;

/* Fewest vertices per cluster, on average: with fewer than 64, a frame spends more on its clusters
 * than they save. If clusters are wanted whatever their cost, errors may demand smaller ones. */
enum { VERTICES_BEST = 64, VERTICES_LEAST = 8 };

/* Modes with which vectors cost no more than clusters: 3 K + 3 is 15. */
enum { MODES_CHEAP = 4 };

/* Compute the RMS of the weight of each mode over all runs and lungs. */
static void find_sizes(const supine_fit *fit, const supine_compression *compression,
                       double *sizes) {
  const size_t m = fit->fields->run_count;
  const size_t count = m * fit->lungs->lung_count;
  double square[SUPINE_MODES_MADE_MAX] = {0.0};
  for (size_t i = 0; i < count; ++i) {
    double weights[SUPINE_MODES_MADE_MAX];
    supine_sh_compression_weights_at(compression, fit->fields->directions + 3 * (i % m),
                                     fit->parameter[i], weights);
    for (size_t k = 0; k < compression->mode_count; ++k) {
      square[k] += weights[k] * weights[k];
    }
  }
  for (size_t k = 0; k < compression->mode_count; ++k) {
    sizes[k] = sqrt(square[k] / (double)count);
  }
}

/* Undo the scaling of the modes by their sizes. */
static void rescale(const double *sizes, supine_clusters *clusters) {
  for (size_t row = 0; row < clusters->count * clusters->mode_count; ++row) {
    const double size = sizes[row % clusters->mode_count];
    for (size_t i = 0; i < SUPINE_CLUSTER_NUMBERS; ++i) {
      float *x = &clusters->vectors[row * SUPINE_CLUSTER_NUMBERS + i];
      *x = size > 0.0 ? (float)((double)*x / size) : 0.0F;
    }
  }
}

static supine_status choose(const supine_clustered *surface, supine_warp_storage storage,
                            double error_mm, supine_clusters *clusters, supine_error *error) {
  const supine_cluster_limits limits = {
      .rms = fmin(largest_mm, beside_fit * error_mm),
      .seam = largest_seam,
      .vertices = storage == SUPINE_FIELD_STORAGE_CLUSTERS ? VERTICES_LEAST : VERTICES_BEST};
  SUPINE_TRY(supine_clusters_choose(surface, &limits, clusters, error));
  if (clusters->count == 0 && storage == SUPINE_FIELD_STORAGE_CLUSTERS) {
    const size_t most = surface->vertex_count / limits.vertices;
    const size_t count = most < SUPINE_CLUSTERS_MAX ? most : SUPINE_CLUSTERS_MAX;
    return supine_clusters_find(surface, count > 2 ? count : 2, clusters, error);
  }
  return SUPINE_OK;
}

supine_status supine_fields_cluster(const supine_fit *fit, const supine_compression *compression,
                                    supine_warp_storage storage, supine_clusters *clusters,
                                    supine_error *error) {
  const supine_lungs *lungs = fit->lungs;
  const size_t n = lungs->mesh.vertex_count;
  const size_t k = compression->mode_count;
  double sizes[SUPINE_MODES_MADE_MAX];
  SUPINE_ARENA arena = {0};
  *clusters = (supine_clusters){0};
  if (storage == SUPINE_FIELD_STORAGE_MODES ||
      (storage == SUPINE_FIELD_STORAGE_BEST && k <= MODES_CHEAP)) {
    return SUPINE_OK;
  }
  float *vertices = supine_arena_take(&arena, 3 * n, sizeof *vertices);
  float *scaled = supine_arena_take(&arena, 3 * n * k, sizeof *scaled);
  SUPINE_TRY(supine_arena_check(&arena, error, "clusters of %zu vertices", n));
  find_sizes(fit, compression, sizes);
  for (size_t i = 0; i < 3 * n; ++i) {
    vertices[i] = (float)lungs->mesh.vertices[i];
  }
  for (size_t i = 0; i < 3 * n * k; ++i) {
    scaled[i] = (float)(sizes[i % k] * (double)compression->coefficients[i]);
  }
  const supine_clustered surface = {.vertex_count = n,
                                    .triangle_count = lungs->mesh.triangle_count,
                                    .mode_count = k,
                                    .part_count = lungs->lung_count,
                                    .part_begin = lungs->lung_begin,
                                    .vertices = vertices,
                                    .triangles = lungs->mesh.triangles,
                                    .coefficients = scaled,
                                    .weight_rms = 1.0};
  SUPINE_TRY(choose(&surface, storage, supine_fields_fit_error(fit) * supine_fields_size(fit),
                    clusters, error));
  rescale(sizes, clusters);
  return SUPINE_OK;
}
