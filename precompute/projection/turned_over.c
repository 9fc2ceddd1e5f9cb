/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Find the share of triangles that a state turns over. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <supine/volume.h>

#include "precompute/projection/accuracy.h"
#include "precompute/projection/compression.h"

enum { SAMPLES_MAX = 50000 };

supine_status supine_accuracy_turned_over(const supine_lungs *lungs, const double *directions,
                                          const supine_compression *compression,
                                          const supine_volume_forms *forms,
                                          const supine_accuracy_state *state, double *share) {
  const supine_mesh *mesh = &lungs->mesh;
  const size_t n = mesh->vertex_count;
  const size_t stride = (mesh->triangle_count + SAMPLES_MAX - 1) / SAMPLES_MAX;
  supine_mesh sample = {n, mesh->vertices, (mesh->triangle_count + stride - 1) / stride,
                        malloc(3 * SAMPLES_MAX * sizeof *sample.triangles)};
  double *amounts = malloc(n * sizeof *amounts);
  double *moved = malloc(3 * n * sizeof *moved);
  const bool memory = sample.triangles != NULL && amounts != NULL && moved != NULL;
  for (size_t t = 0; t < sample.triangle_count && memory; ++t) {
    memcpy(sample.triangles + 3 * t, mesh->triangles + 3 * t * stride,
           3 * sizeof *sample.triangles);
  }
  *share = 0.0;
  for (size_t posture = 0; posture < 6 && memory; ++posture) {
    double g[3] = {0.0, 0.0, 0.0};
    double weights[SUPINE_MODES_MADE_MAX];
    double cubic[3];
    double scale = 0.0;
    g[posture / 2] = posture % 2 == 0 ? 1.0 : -1.0;
    supine_projection_compression_weights(compression, g, weights);
    supine_physics_volume_forms_contract(forms, weights, cubic);
    if (supine_volume_scale(cubic, supine_accuracy_state_volume(state, g), &scale, NULL) !=
        SUPINE_OK) {
      continue;
    }
    supine_projection_compression_field(compression, weights, amounts);
    for (size_t i = 0; i < 3 * n; ++i) {
      moved[i] = mesh->vertices[i] + scale * amounts[i / 3] * directions[i];
    }
    *share = fmax(*share, supine_mesh_turned_over(&sample, moved));
  }
  free(sample.triangles);
  free(amounts);
  free(moved);
  return memory ? SUPINE_OK : SUPINE_ERROR_MEMORY;
}
