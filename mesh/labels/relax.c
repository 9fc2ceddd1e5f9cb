/* SPDX-License-Identifier: MIT */
/* Smooth a surface net by alternate shrinking and inflation, which keeps long waves
 * [Taubin1995]. */
#include <stdlib.h>

#include "mesh/labels/mask.h"

/* 1 / 0.5 - 1 / 0.51 = 0.04: keeps waves longer than some 16 cubes, removes terraces of slices. */
static const double shrink = 0.5;
static const double swell = -0.51;
enum { TURNS = 40 };

/* Move every vertex by a share of the way to the mean of its neighbours, within its cell. */
static void step(const labels_net *net, double share, double (*next)[3]) {
  for (size_t v = 0; v < net->count; ++v) {
    double sum[3] = {0.0, 0.0, 0.0};
    double count = 0.0;
    for (size_t n = 0; n < 6; ++n) {
      const uint32_t other = net->neighbour[v][n];
      for (size_t a = 0; other != LABELS_NONE && a < 3; ++a) {
        sum[a] += (double)net->cell[other][a] - (double)net->cell[v][a] + net->at[other][a];
      }
      count += other != LABELS_NONE;
    }
    for (size_t a = 0; a < 3; ++a) {
      const double here = net->at[v][a];
      const double there = here + share * (sum[a] / count - here);
      next[v][a] = there < 0.0 ? 0.0 : there > 1.0 ? 1.0 : there;
    }
  }
}

supine_status supine_labels_net_relax(labels_net *net) {
  double(*next)[3] = malloc((net->count + 1) * sizeof *next);
  if (next == NULL) {
    return SUPINE_ERROR_MEMORY;
  }
  for (int turn = 0; turn < 2 * TURNS; ++turn) {
    step(net, turn % 2 == 0 ? shrink : swell, next);
    double(*old)[3] = net->at;
    net->at = next;
    next = old;
  }
  free(next);
  return SUPINE_OK;
}
