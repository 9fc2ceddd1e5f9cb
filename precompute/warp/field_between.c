/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute the displacement field from one pose to another. */
#include <stdlib.h>

#include "base/arena.h"
#include "precompute/warp/field.h"

/* Replace `second`, the displacement from the scan to state B, by u, the displacement from state A
 * to B: u(x) = v(x) + second(x + v(x)). v is the inverse of `first`, the displacement from the scan
 * to A. Also replace each node's depth below the lungs' surface by its depth in state A. */
static supine_status join(const supine_field *first, supine_field *second, supine_error *error) {
  SUPINE_FREED_BY(supine_warp_free) supine_field back = {0};
  supine_warp_residual residual;
  supine_image depth;
  SUPINE_TRY(supine_warp_invert(first, &back, &residual, error));
  const size_t *size = second->nodes.size;
  const size_t count = size[0] * size[1] * size[2];
  float *u = malloc(3 * count * sizeof *u);
  if (u == NULL) {
    return supine_error_memory(error, "%zu nodes", count);
  }
  for (size_t i = 0; i < count; ++i) {
    const float *v = (const float *)back.nodes.values + 3 * i;
    double place[3];
    double moved[3];
    supine_image_place(&second->nodes, i, place);
    for (size_t k = 0; k < 3; ++k) {
      place[k] += (double)v[k];
    }
    supine_warp_at(second, place, moved);
    for (size_t k = 0; k < 3; ++k) {
      u[3 * i + k] = (float)(moved[k] + (double)v[k]);
    }
  }
  free(second->nodes.values);
  second->nodes.values = u;
  SUPINE_TRY(supine_warp_resample(&back, NULL, false, &second->depth, &depth, error));
  supine_image_free(&second->depth);
  second->depth = depth;
  SUPINE_TRY(supine_warp_resample(&back, NULL, true, &second->lung, &depth, error));
  supine_image_free(&second->lung);
  second->lung = depth;
  return SUPINE_OK;
}

supine_status supine_warp_between(const supine_basis *basis, const supine_pose *from,
                                  const supine_pose *to, const float *deviation,
                                  supine_field *field, supine_error *error) {
  SUPINE_FREED_BY(supine_warp_free) supine_field first = {0};
  SUPINE_TRY(supine_warp_create(basis, to, deviation, field, error));
  if (from == NULL) {
    return SUPINE_OK;
  }
  SUPINE_TRY(supine_warp_create(basis, from, NULL, &first, error));
  return join(&first, field, error);
}
