/* SPDX-License-Identifier: MIT */
/* The surface of a mask. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "mesh/labels/mask.h"

supine_status supine_labels_mask_surface(const labels_mask *mask, double edge, bool one,
                                         double *held, double *farthest, supine_mesh *mesh) {
  labels_cubes cubes = {.share = NULL};
  labels_net net = {0};
  double(*before)[3] = NULL;
  supine_status status = supine_labels_cubes_create(mask, edge, one, &cubes);
  status = status == SUPINE_OK ? supine_labels_net_create(&cubes, &net) : status;
  if (status == SUPINE_OK) {
    before = malloc((net.count + 1) * sizeof *before);
    status = before == NULL ? SUPINE_ERROR_MEMORY : SUPINE_OK;
  }
  if (status == SUPINE_OK && net.count > 0) {
    memcpy(before, net.at, net.count * sizeof *before);
    status = supine_labels_net_relax(&net);
  }
  if (status == SUPINE_OK) {
    *held = 0.5 * fmax(edge, fmax(mask->spacing[0], fmax(mask->spacing[1], mask->spacing[2])));
    *farthest = supine_labels_net_hold(&net, (const double(*)[3])before, &cubes, mask, *held);
    status = supine_labels_net_mesh(&net, &cubes, mask, mesh);
  }
  free(before);
  supine_labels_net_free(&net);
  supine_labels_cubes_free(&cubes);
  return status;
}
