/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Judge whether something belongs to lungs by how much of it lies outside them. */
#include <math.h>

#include "precompute/lungs/belong.h"

/* Share of the distance from the midline to the side of the lungs that counts as between them. */
static const double between = 0.35;

void supine_lungs_belong_add(supine_lungs_belong *found, double depth) {
  ++found->count;
  found->outside += depth < -found->rim;
  found->farthest = fmax(found->farthest, -depth);
}

void supine_lungs_belong_add_points(supine_lungs_belong *found, const supine_lungs_surface *surface,
                                    size_t count, const double *points) {
  supine_inside_place place = {.depth = 0.0};
  for (size_t i = 0; i < count; ++i) {
    place = supine_lungs_surface_find(surface, points + 3 * i, i > 0 ? &place : NULL);
    supine_lungs_belong_add(found, place.depth);
  }
}

double supine_lungs_belong_share(const supine_lungs_belong *found) {
  return found->count > 0 ? (double)found->outside / (double)found->count : 0.0;
}

supine_input_verdict supine_lungs_belong_judge(const supine_lungs_belong *found,
                                               supine_input_id row, const char *what,
                                               const char *lungs, supine_findings *findings) {
  const supine_input_verdict verdict = supine_input_judge(row, supine_lungs_belong_share(found));
  if (verdict != SUPINE_INPUT_TAKEN) {
    supine_findings_warn(findings,
                         "%zu of %zu %s lie outside the lungs of the %s, by up to %.0f mm: check "
                         "that they are this person's, and their axes",
                         found->outside, found->count, what, lungs, found->farthest);
  }
  return verdict;
}

bool supine_lungs_is_between(const double low[3], const double high[3], int side,
                             const double point[3]) {
  double from_midline = fabs(point[0] - 0.5 * (low[0] + high[0]));
  double reach = 0.5 * (high[0] - low[0]);
  if (side != 0) {
    from_midline = fabs(point[0] - (side > 0 ? low[0] : high[0]));
    reach = high[0] - low[0];
  }
  return from_midline < between * reach;
}
