/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Smoothed aggregation on a graph. */
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "precompute/physics/coarse.h"

/* Share of a vertex that smoothing gives to its neighbours' aggregates: 4 / 3 over the largest
 * eigenvalue of the scaled Laplacian, which is 1.5 on a lattice of triangles and at most 2. */
static const double smoothing = 0.8;

/* Least strength of a link, relative to the strongest link of both its ends, that joins them:
 * across weaker links errors are not smooth (slivers). */
static const float strong = 0.33F;

static const uint32_t none = UINT32_MAX;

static float strongest(const supine_rows *links, size_t i) {
  float most = 0.0F;
  for (size_t s = links->begin[i]; s < links->begin[i + 1]; ++s) {
    most = fmaxf(most, links->value[s]);
  }
  return most;
}

/* Aggregate each vertex with all its neighbours if none is taken; add every other vertex to its
 * most strongly linked neighbour's aggregate. Return the number of aggregates. */
static size_t aggregate(const supine_rows *links, const float *least, uint32_t *of) {
  size_t count = 0;
  memset(of, 0xff, links->count * sizeof *of);
  for (size_t i = 0; i < links->count; ++i) {
    bool untaken = of[i] == none;
    for (size_t s = links->begin[i]; s < links->begin[i + 1] && untaken; ++s) {
      untaken = links->value[s] < least[i] || of[links->column[s]] == none;
    }
    if (!untaken) {
      continue;
    }
    of[i] = (uint32_t)count;
    for (size_t s = links->begin[i]; s < links->begin[i + 1]; ++s) {
      if (links->value[s] >= least[i]) {
        of[links->column[s]] = (uint32_t)count;
      }
    }
    ++count;
  }
  const size_t whole = count; /* vertices added later do not attract others */
  for (size_t i = 0; i < links->count; ++i) {
    float most = 0.0F;
    uint32_t best = none;
    for (size_t s = links->begin[i]; s < links->begin[i + 1] && of[i] == none; ++s) {
      const uint32_t other = of[links->column[s]];
      if (other < whole && links->value[s] > most) {
        most = links->value[s];
        best = other;
      }
    }
    if (of[i] == none) {
      of[i] = best != none ? best : (uint32_t)count++;
    }
  }
  return count;
}

typedef struct level_work {
  const supine_rows *links, *part, *whole;
  const uint32_t *of;
  const double *total; /* sum of each row of links */
} level_work;

/* Row i of (1 - smoothing diag(total)^-1 L) with 1 for every vertex in its aggregate: shares of at
 * least 0, which sum to 1. */
static void sum_part(const void *context, size_t i, supine_row *row) {
  const level_work *work = context;
  const supine_rows *links = work->links;
  const double factor = work->total[i] > 0.0 ? smoothing / work->total[i] : 0.0;
  supine_physics_row_add(row, work->of[i], work->total[i] > 0.0 ? 1.0 - smoothing : 1.0);
  for (size_t s = links->begin[i]; s < links->begin[i + 1]; ++s) {
    supine_physics_row_add(row, work->of[links->column[s]], factor * (double)links->value[s]);
  }
}

/* Row a of -P^T L P without its diagonal, which follows: rows sum to 0 as those of L do. */
static void sum_links(const void *context, size_t a, supine_row *row) {
  const level_work *work = context;
  const supine_rows *links = work->links;
  const supine_rows *part = work->part;
  for (size_t w = work->whole->begin[a]; w < work->whole->begin[a + 1]; ++w) {
    const uint32_t i = work->whole->column[w];
    const double share = (double)work->whole->value[w];
    for (size_t p = part->begin[i]; p < part->begin[i + 1]; ++p) {
      supine_physics_row_add(row, part->column[p],
                             -share * work->total[i] * (double)part->value[p]);
    }
    for (size_t s = links->begin[i]; s < links->begin[i + 1]; ++s) {
      const uint32_t j = links->column[s];
      const double factor = share * (double)links->value[s];
      for (size_t p = part->begin[j]; p < part->begin[j + 1]; ++p) {
        supine_physics_row_add(row, part->column[p], factor * (double)part->value[p]);
      }
    }
  }
  for (size_t k = 0; k < row->count; ++k) { /* the diagonal out */
    if (row->column[k] == a) {
      row->place[a] = none;
      row->column[k] = row->column[--row->count];
      row->value[k] = row->value[row->count];
    }
  }
}

/* Build the next level; without rows of links if coarsening stops here. */
static supine_status coarsen(supine_level *level, supine_rows *coarse) {
  const size_t n = level->links.count;
  uint32_t *of = malloc((n + 1) * sizeof *of);
  float *least = malloc((n + 1) * sizeof *least);
  double *total = malloc((n + 1) * sizeof *total);
  supine_status status = SUPINE_ERROR_MEMORY;
  *coarse = (supine_rows){0};
  if (of == NULL || least == NULL || total == NULL) {
    goto cleanup;
  }
  for (size_t i = 0; i < n; ++i) {
    least[i] = strong * strongest(&level->links, i);
    total[i] = 0.0;
    for (size_t s = level->links.begin[i]; s < level->links.begin[i + 1]; ++s) {
      total[i] += (double)level->links.value[s];
    }
  }
  const size_t count = aggregate(&level->links, least, of);
  level_work work = {&level->links, &level->part, &level->whole, of, total};
  status = SUPINE_OK;
  if (count < n) {
    status = supine_physics_rows_build(n, count, sum_part, &work, &level->part);
  }
  if (count < n && status == SUPINE_OK) {
    status = supine_physics_rows_transpose(&level->part, count, &level->whole);
  }
  if (count < n && status == SUPINE_OK) {
    status = supine_physics_rows_build(count, count, sum_links, &work, coarse);
  }
cleanup:
  free(of);
  free(least);
  free(total);
  return status;
}

supine_status supine_physics_hierarchy_create(const supine_rows *links,
                                              supine_hierarchy **hierarchy) {
  supine_hierarchy *made = calloc(1, sizeof *made);
  *hierarchy = NULL;
  if (made == NULL) {
    return SUPINE_ERROR_MEMORY;
  }
  made->level[0].links = *links;
  made->level_count = 1;
  while (made->level_count < SUPINE_LEVELS_MAX) {
    supine_level *last = &made->level[made->level_count - 1];
    supine_rows coarse = {0};
    if (last->links.begin[last->links.count] > 0 && coarsen(last, &coarse) != SUPINE_OK) {
      supine_physics_hierarchy_destroy(made);
      return SUPINE_ERROR_MEMORY;
    }
    if (coarse.count == 0) {
      break;
    }
    made->level[made->level_count++].links = coarse;
  }
  *hierarchy = made;
  return SUPINE_OK;
}

void supine_physics_hierarchy_destroy(supine_hierarchy *hierarchy) {
  if (hierarchy != NULL) {
    for (size_t k = 0; k < hierarchy->level_count; ++k) {
      if (k > 0) { /* the first level's belong to the network */
        supine_physics_rows_free(&hierarchy->level[k].links);
      }
      supine_physics_rows_free(&hierarchy->level[k].part);
      supine_physics_rows_free(&hierarchy->level[k].whole);
    }
    free(hierarchy);
  }
}
