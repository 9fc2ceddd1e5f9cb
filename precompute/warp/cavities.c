/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Find the cavities of soft tissue in an image: air that soft tissue encloses. */
#include "base/arena.h"
#include "mesh/compact.h"
#include "mesh/labels/mask.h"
#include "precompute/warp/tissue.h"

/* Find the box of the rows' spans: voxels low <= i < high along each axis. */
static void find_box(const supine_tissue *tissue, size_t low[3], size_t high[3]) {
  const size_t *size = tissue->kind.size;
  for (size_t a = 0; a < 3; ++a) {
    low[a] = size[a];
    high[a] = 0;
  }
  for (size_t row = 0; row < size[1] * size[2]; ++row) {
    const supine_warp_span *span = &tissue->span[row];
    const size_t first[3] = {span->begin, row % size[1], row / size[1]};
    const size_t end[3] = {span->end, first[1] + 1, first[2] + 1};
    if (span->begin == span->end) {
      continue;
    }
    for (size_t a = 0; a < 3; ++a) {
      low[a] = first[a] < low[a] ? first[a] : low[a];
      high[a] = end[a] > high[a] ? end[a] : high[a];
    }
  }
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
  find_box(tissue, low, high);
  if (low[0] >= high[0]) {
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
      soft.at[soft.size[0] * row + i] =
          (first[size[0] * of + i] & SUPINE_TISSUE_STAGE) == SUPINE_TISSUE_SOFT;
    }
  }
  if (supine_labels_pieces_find(&soft, true, &arena, &pieces) != SUPINE_OK) {
    return supine_error_memory(error, "cavities of soft tissue");
  }
  for (size_t row = 0; row < rows; ++row) {
    const size_t of = low[1] + row % soft.size[1] + size[1] * (low[2] + row / soft.size[1]);
    for (size_t r = pieces.row[row]; r < pieces.row[row + 1]; ++r) {
      const labels_run *run = &pieces.run[r];
      if ((double)pieces.piece[run->parent].count < most) {
        fill(first + size[0] * of + run->begin, run->end - run->begin);
      }
    }
  }
  return SUPINE_OK;
}
