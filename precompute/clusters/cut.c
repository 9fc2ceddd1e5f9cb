/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Cut vertices into compact groups of equal size. */
#include <math.h>

#include "precompute/clusters/cut.h"

/* Partition `order` so that its first `rank` vertices have the lowest coordinates along `axis`
 * (Hoare's selection). */
static void select_lowest(const float *vertices, size_t axis, size_t rank, uint32_t *order,
                          size_t count) {
  size_t low = 0;
  size_t high = count - 1;
  while (low < high) {
    const float pivot = vertices[3 * (size_t)order[low + (high - low) / 2] + axis];
    size_t i = low;
    size_t j = high;
    for (;;) {
      while (vertices[3 * (size_t)order[i] + axis] < pivot) {
        ++i;
      }
      while (vertices[3 * (size_t)order[j] + axis] > pivot) {
        --j;
      }
      if (i >= j) {
        break;
      }
      const uint32_t kept = order[i];
      order[i++] = order[j];
      order[j--] = kept;
    }
    if (rank <= j) {
      high = j;
    } else {
      low = j + 1;
    }
  }
}

static size_t longest_side(const float *vertices, const uint32_t *order, size_t count) {
  size_t longest = 0;
  float length = -1;
  for (size_t axis = 0; axis < 3; ++axis) {
    float low = INFINITY;
    float high = -INFINITY;
    for (size_t i = 0; i < count; ++i) {
      const float x = vertices[3 * (size_t)order[i] + axis];
      low = fminf(low, x);
      high = fmaxf(high, x);
    }
    if (high - low > length) {
      length = high - low;
      longest = axis;
    }
  }
  return longest;
}

/* Cut `count` vertices into `groups` groups, numbered from `first`. The depth of the recursion is
 * the logarithm of the number of groups. */
static void cut(const supine_clustered *surface, uint32_t *order, size_t count, size_t groups,
                size_t first, uint16_t *group) {
  if (groups == 1) {
    for (size_t i = 0; i < count; ++i) {
      group[order[i]] = (uint16_t)first;
    }
    return;
  }
  const size_t lower = groups / 2;
  const size_t rank = count * lower / groups;
  select_lowest(surface->vertices, longest_side(surface->vertices, order, count), rank, order,
                count);
  cut(surface, order, rank, lower, first, group);
  cut(surface, order + rank, count - rank, groups - lower, first + lower, group);
}

size_t supine_clusters_cut(const supine_clustered *surface, size_t count, uint32_t *order,
                           uint16_t *group) {
  size_t first = 0;
  for (size_t part = 0; part < surface->part_count; ++part) {
    const size_t begin = surface->part_begin[part];
    const size_t size = surface->part_begin[part + 1] - begin;
    if (size > 0) {
      const double share = (double)count * (double)size / (double)surface->vertex_count;
      const size_t wanted = share < 1 ? 1 : (size_t)lround(share);
      const size_t groups = wanted < size ? wanted : size;
      for (size_t i = 0; i < size; ++i) {
        order[i] = (uint32_t)(begin + i);
      }
      cut(surface, order, size, groups, first, group);
      first += groups;
    }
  }
  return first;
}
