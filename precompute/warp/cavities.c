/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Find the cavities of soft tissue in an image: air that soft tissue encloses. */
#include "base/arena.h"
#include "mesh/compact.h"
#include "mesh/labels/mask.h"
#include "precompute/warp/tissue.h"

/* Make the voxels of a run soft. */
static void fill(unsigned char *voxel, const labels_run *run) {
  for (size_t i = run->begin; i < run->end; ++i) {
    voxel[i] = (unsigned char)((voxel[i] & ~(unsigned)SUPINE_TISSUE_STAGE) | SUPINE_TISSUE_SOFT);
  }
}

supine_status supine_warp_tissue_fill(supine_image *kind, supine_error *error) {
  SUPINE_ARENA arena = {0};
  const double most = SUPINE_COMPACT_MOST_ML / supine_warp_tissue_voxel(kind);
  const size_t rows = kind->size[1] * kind->size[2];
  const size_t voxels = kind->size[0] * rows;
  unsigned char *voxel = kind->values;
  labels_mask soft = {.size = {kind->size[0], kind->size[1], kind->size[2]},
                      .at = supine_arena_take(&arena, voxels, 1)};
  labels_pieces pieces;
  SUPINE_TRY(supine_arena_check(&arena, error, "cavities of soft tissue"));
  for (size_t i = 0; i < voxels; ++i) {
    soft.at[i] = (voxel[i] & SUPINE_TISSUE_STAGE) == SUPINE_TISSUE_SOFT;
  }
  if (supine_labels_pieces_find(&soft, true, &arena, &pieces) != SUPINE_OK) {
    return supine_error_memory(error, "cavities of soft tissue");
  }
  for (size_t row = 0; row < rows; ++row) {
    for (size_t r = pieces.row[row]; r < pieces.row[row + 1]; ++r) {
      const labels_run *run = &pieces.run[r];
      if ((double)pieces.piece[run->parent].count < most) {
        fill(voxel + row * kind->size[0], run);
      }
    }
  }
  return SUPINE_OK;
}
