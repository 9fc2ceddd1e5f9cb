/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Put compact parts of soft tissue that are close to each other into groups. */
#include <math.h>
#include <stdlib.h>

#include "base/arena.h"
#include "base/vec3.h"

#include "precompute/warp/tissue.h"

/* Parts farther apart than this do not influence each other's motion, mm: the
 * transition of two balls of 7 mL close to each other was 24 mm wide. */
static const double apart = 40.0;

/* Return the distance between two parts, mm, or a bound that is at least `apart`. */
static double gap_between(const supine_warp_part *a, const supine_warp_part *b) {
  const double least = supine_distance(a->centre, b->centre) - a->reach - b->reach;
  if (least >= apart) {
    return least;
  }
  double gap = INFINITY;
  for (size_t i = 0; i < a->outline_count; ++i) {
    for (size_t j = 0; j < b->outline_count; ++j) {
      gap = fmin(gap, supine_distance(a->outline + 3 * i, b->outline + 3 * j));
    }
  }
  return gap;
}

/* Give the parts of group `from` the group `to`. */
static void join_groups(supine_tissue *tissue, size_t from, size_t to) {
  for (size_t i = 0; i < tissue->part_count; ++i) {
    if (tissue->parts[i].group == from) {
      tissue->parts[i].group = to;
    }
  }
}

/* Number the groups from 0, in the order of their first parts. */
static void number_groups(supine_tissue *tissue) {
  tissue->group_count = 0;
  for (size_t i = 0; i < tissue->part_count; ++i) {
    if (tissue->parts[i].group == i) { /* the first part of a group names it */
      join_groups(tissue, i, tissue->group_count++);
    }
  }
}

supine_status supine_warp_tissue_group(supine_tissue *tissue, supine_error *error) {
  const size_t n = tissue->part_count;
  SUPINE_ARENA arena = {0};
  double *gap = supine_arena_take(&arena, n * n, sizeof *gap);
  free(tissue->gap);
  tissue->gap = malloc((n + 1) * sizeof *tissue->gap);
  if (arena.failed || tissue->gap == NULL) {
    return supine_error_memory(error, "%zu parts", n);
  }
  for (size_t i = 0; i < n; ++i) {
    tissue->parts[i].group = i;
  }
  for (size_t i = 0; i < n; ++i) {
    for (size_t j = 0; j < i; ++j) {
      const supine_warp_part *a = &tissue->parts[i];
      const supine_warp_part *b = &tissue->parts[j];
      gap[i * n + j] = gap_between(a, b);
      /* Between parts closer than that, two motions would compress the tissue until it folds. */
      if (gap[i * n + j] < 0.5 * (a->radius + b->radius)) {
        join_groups(tissue, a->group > b->group ? a->group : b->group,
                    a->group > b->group ? b->group : a->group);
      }
    }
  }
  number_groups(tissue);
  for (size_t i = 0; i < n; ++i) {
    tissue->gap[i] = INFINITY;
  }
  for (size_t i = 0; i < n; ++i) {
    for (size_t j = 0; j < i; ++j) {
      const size_t of[2] = {tissue->parts[i].group, tissue->parts[j].group};
      if (of[0] != of[1]) {
        for (size_t k = 0; k < 2; ++k) {
          tissue->gap[of[k]] = fmin(tissue->gap[of[k]], gap[i * n + j]);
        }
      }
    }
  }
  return SUPINE_OK;
}
