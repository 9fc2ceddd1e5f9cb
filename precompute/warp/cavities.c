/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Find the cavities of soft tissue in an image: air that soft tissue encloses. */
#include <string.h>

#include "base/arena.h"
#include "mesh/compact.h"
#include "mesh/labels/mask.h"
#include "precompute/warp/tissue.h"

static bool is_soft(unsigned char voxel) {
  return (voxel & SUPINE_TISSUE_STAGE) == SUPINE_TISSUE_SOFT;
}

/* Find the box of the soft voxels, and a layer around it: voxels low <= i < high along each axis.
 * Return whether there are any. */
static bool find_box(const supine_tissue *tissue, size_t low[3], size_t high[3]) {
  const size_t *size = tissue->kind.size;
  memcpy(low, size, 3 * sizeof *low);
  memset(high, 0, 3 * sizeof *high);
  for (size_t row = 0; row < size[1] * size[2]; ++row) {
    const unsigned char *voxel = (const unsigned char *)tissue->kind.values + size[0] * row;
    size_t first = tissue->span[row].begin;
    size_t end = tissue->span[row].end;
    while (first < end && !is_soft(voxel[first])) {
      ++first;
    }
    while (end > first && !is_soft(voxel[end - 1])) {
      --end;
    }
    const size_t at[3] = {first, row % size[1], row / size[1]};
    const size_t past[3] = {end, at[1] + 1, at[2] + 1};
    if (first == end) {
      continue;
    }
    for (size_t a = 0; a < 3; ++a) {
      low[a] = at[a] < low[a] ? at[a] : low[a];
      high[a] = past[a] > high[a] ? past[a] : high[a];
    }
  }
  for (size_t a = 0; a < 3; ++a) {
    low[a] -= low[a] > 0 ? 1 : 0;
    high[a] += high[a] < size[a] ? 1 : 0;
  }
  return high[0] > low[0];
}

/* Make `count` voxels soft. */
static void fill(unsigned char *voxel, size_t count) {
  for (size_t i = 0; i < count; ++i) {
    voxel[i] = (unsigned char)((voxel[i] & ~(unsigned)SUPINE_TISSUE_STAGE) | SUPINE_TISSUE_SOFT);
  }
}

supine_status supine_warp_tissue_fill(supine_tissue *tissue, supine_error *error) {
  SUPINE_ARENA arena = {0};
  const double most = SUPINE_COMPACT_MOST_ML / supine_warp_tissue_voxel(&tissue->kind);
  const size_t *size = tissue->kind.size;
  size_t low[3];
  size_t high[3];
  if (!find_box(tissue, low, high)) {
    return SUPINE_OK;
  }
  labels_mask soft = {.size = {high[0] - low[0], high[1] - low[1], high[2] - low[2]}};
  const size_t rows = soft.size[1] * soft.size[2];
  labels_pieces pieces;
  soft.at = supine_arena_take(&arena, soft.size[0] * rows, 1);
  SUPINE_TRY(supine_arena_check(&arena, error, "cavities of soft tissue"));
  unsigned char *first = (unsigned char *)tissue->kind.values + low[0];
  for (size_t row = 0; row < rows; ++row) {
    const size_t of = low[1] + row % soft.size[1] + size[1] * (low[2] + row / soft.size[1]);
    for (size_t i = 0; i < soft.size[0]; ++i) {
      soft.at[soft.size[0] * row + i] = is_soft(first[size[0] * of + i]);
    }
  }
  if (supine_labels_pieces_find(&soft, true, &arena, &pieces) != SUPINE_OK) {
    return supine_error_memory(error, "cavities of soft tissue");
  }
  for (size_t row = 0; row < rows; ++row) {
    const size_t of = low[1] + row % soft.size[1] + size[1] * (low[2] + row / soft.size[1]);
    for (size_t r = pieces.row[row]; r < pieces.row[row + 1]; ++r) {
      const labels_run *run = &pieces.run[r];
      const bool outside = run->parent == 0; /* the piece of the layer around the box */
      if (!outside && (double)pieces.piece[run->parent].count < most) {
        fill(first + size[0] * of + run->begin, run->end - run->begin);
      }
    }
  }
  return SUPINE_OK;
}
