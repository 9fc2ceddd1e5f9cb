/* SPDX-License-Identifier: MIT */
/* Evaluate many poses at once: convert each block of tiles to floats once, so that the block stays
 * in the cache while it is evaluated for every pose. */
#include <string.h>

#include "runtime/internal.h"

enum {
  BLOCK_TILES = 23,      /* largest number of tiles in a block */
  BLOCK_BYTES = 32768,   /* size of a block in bytes, smaller than a first-level cache */
  WEIGHT_NUMBERS = 4096, /* largest number of folded weights and gains of a group of poses */
  GROUP = 256            /* largest number of poses in a group */
};

typedef struct block {
  _Alignas(64) unsigned char bytes[BLOCK_BYTES];
  float folded[WEIGHT_NUMBERS];
  float held[GROUP][16]; /* supine_target.held for each pose */
} block;

/* Evaluate whole tiles of one lung for `count` poses. `positions` points to the first position of
 * pose 0; the positions of pose j begin j * apart floats later. The nine parameters are the poses,
 * the range of tiles, and the work space and output of a batch. */
static void batch_tiles(const supine_basis *basis, size_t count, block *scratch, supine_tiles *wide,
                        size_t first, size_t tiles, float *positions, size_t apart, bool stream) {
  const size_t fit = BLOCK_BYTES / wide->stride;
  const size_t step = fit < BLOCK_TILES ? fit : BLOCK_TILES;
  for (size_t t = 0; t < tiles; t += step) {
    const size_t here = tiles - t < step ? tiles - t : step;
    basis->kernels->widen(&basis->tiles, first + t, here, wide);
    for (size_t j = 0; j < count; ++j) {
      const supine_target target = {.xyz = positions + j * apart + t * TILE_NUMBERS,
                                    .add_reference = true,
                                    .stream = stream,
                                    .held = scratch->held[j],
                                    .continues = t > 0,
                                    .continued = t + here < tiles};
      basis->kernels->deform(wide, scratch->folded + j * (basis->info.mode_count + 3), 0, here,
                             &target);
    }
  }
}

void supine_deform_batch(const supine_basis *basis, size_t count, const supine_pose *poses,
                         size_t begin, size_t end, float *xyz) {
  block scratch;
  supine_tiles wide = {0};
  const size_t modes = basis->info.mode_count;
  const size_t lungs = basis->info.lung_count;
  const size_t apart = 3 * (end - begin);
  const size_t group = WEIGHT_NUMBERS / (modes + 3) < GROUP ? WEIGHT_NUMBERS / (modes + 3) : GROUP;
  const double bytes = (double)count * (double)apart * sizeof *xyz;
  const bool stream = bytes > STREAM_BATCH_BYTES;
  supine_tiles_layout(&wide, SUPINE_STORAGE_EXACT, modes, basis->info.vector, BLOCK_TILES);
  wide.bytes = scratch.bytes;
  for (size_t lung = 0; lung < lungs; ++lung) {
    const size_t first = basis->lung_begin[lung] > begin ? basis->lung_begin[lung] : begin;
    const size_t last = basis->lung_begin[lung + 1] < end ? basis->lung_begin[lung + 1] : end;
    if (first >= last) {
      continue;
    }
    /* Evaluate whole tiles in blocks. Evaluate the vertices before and after them pose by pose, and
     * all vertices if one tile is larger than a block. */
    size_t from = (first + TILE - 1) / TILE * TILE;
    size_t to = last / TILE * TILE;
    if (from >= to || wide.stride > BLOCK_BYTES) {
      from = to = last;
    }
    for (size_t j = 0; j < count; j += group) {
      const size_t here = count - j < group ? count - j : group;
      for (size_t i = 0; i < here; ++i) {
        supine_fold(basis, &poses[j + i], lung, scratch.folded + i * (modes + 3));
      }
      batch_tiles(basis, here, &scratch, &wide, from / TILE, (to - from) / TILE,
                  xyz + j * apart + 3 * (from - begin), apart, stream);
    }
    for (size_t j = 0; j < count; ++j) {
      float *positions = xyz + j * apart;
      supine_deform_range(basis, &poses[j], first, from, positions + 3 * (first - begin));
      supine_deform_range(basis, &poses[j], to, last, positions + 3 * (to - begin));
    }
  }
  supine_stream_fence(stream);
  for (size_t j = 0; j < count && basis->rigid_count > 0; ++j) {
    supine_deform_rigid(basis, &poses[j], begin, end,
                        &(supine_target){.xyz = xyz + j * apart, .add_reference = true});
  }
}
