/* SPDX-License-Identifier: MIT */
/* Find connected pieces of voxels that share faces, by teem. */
#include <string.h>

#include <teem/nrrd.h>

#include "base/library.h"
#include "mesh/labels/mask.h"

/* clang-format off */
#define FUNCTIONS(EACH)                                                                            \
  EACH(, nrrdNew) EACH(, nrrdWrap_nva) EACH(, nrrdCCFind) EACH(, nrrdNix) EACH(, nrrdNuke)
/* clang-format on */
static struct { FUNCTIONS(SUPINE_LIBRARY_MEMBER) } teem;

supine_status supine_labels_pieces_begin(supine_error *error) {
  return SUPINE_LIBRARY_LOAD(SUPINE_TEEM, FUNCTIONS, &teem, error);
}

/* Number the connected pieces of voxels of equal value, in the order of their first voxels.
 * @param of  [voxels] written: the piece of each voxel */
static supine_status number_pieces(const labels_mask *mask, uint32_t *of) {
  enum { FACES = 1 };
  Nrrd *in = teem.nrrdNew();
  Nrrd *out = teem.nrrdNew();
  const bool good = in != NULL && out != NULL &&
                    teem.nrrdWrap_nva(in, mask->at, nrrdTypeUChar, 3, mask->size) == 0 &&
                    teem.nrrdCCFind(out, NULL, in, nrrdTypeUInt, FACES) == 0;
  if (good) {
    memcpy(of, out->data, supine_labels_mask_count(mask) * sizeof *of);
  }
  (void)teem.nrrdNix(in);
  (void)teem.nrrdNuke(out);
  return good ? SUPINE_OK : SUPINE_ERROR_MEMORY;
}

supine_status supine_labels_pieces_find(const labels_mask *mask, bool zero, supine_arena *arena,
                                        labels_pieces *pieces) {
  const size_t count = supine_labels_mask_count(mask);
  const size_t *size = mask->size;
  *pieces = (labels_pieces){.of = supine_arena_take(arena, count, sizeof *pieces->of)};
  SUPINE_TRY(supine_arena_status(arena));
  SUPINE_TRY(number_pieces(mask, pieces->of));
  for (size_t i = 0; i < count; ++i) {
    pieces->end = pieces->of[i] >= pieces->end ? pieces->of[i] + 1 : pieces->end;
  }
  pieces->piece = supine_arena_zeros(arena, pieces->end, sizeof *pieces->piece);
  for (size_t i = 0; i < count && pieces->piece != NULL; ++i) {
    if ((mask->at[i] == 0) == zero) {
      labels_piece *piece = &pieces->piece[pieces->of[i]];
      pieces->count += piece->count++ == 0;
      piece->sum[0] += (double)(i % size[0]);
      piece->sum[1] += (double)(i / size[0] % size[1]);
      piece->sum[2] += (double)(i / size[0] / size[1]);
    }
  }
  return pieces->piece != NULL ? SUPINE_OK : SUPINE_ERROR_MEMORY;
}

supine_status supine_labels_keep_one(labels_mask *mask, bool zero, size_t *others, size_t *voxels) {
  SUPINE_ARENA arena = {0};
  labels_pieces pieces;
  SUPINE_TRY(supine_labels_pieces_find(mask, zero, &arena, &pieces));
  uint32_t kept = pieces.of[0]; /* voxel 0 is in the outer margin */
  for (uint32_t p = 0; !zero && p < pieces.end; ++p) {
    kept = pieces.piece[p].count > pieces.piece[kept].count ? p : kept;
  }
  *others = pieces.count > 0 ? pieces.count - 1 : 0;
  *voxels = 0;
  for (size_t i = 0; i < supine_labels_mask_count(mask); ++i) {
    if ((mask->at[i] == 0) == zero && pieces.of[i] != kept) {
      mask->at[i] = zero;
      ++*voxels;
    }
  }
  return SUPINE_OK;
}
