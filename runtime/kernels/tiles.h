/* SPDX-License-Identifier: MIT */
/** @file
 * Layout of a basis in memory for the kernels: tiles of 16 vertices, each of whole cache lines.
 *
 *     coefficients   for each axis (1 for scalar fields, 3 for vector fields)
 *                      EXACT  16 floats for each mode
 *                      INT16  16 words of 32 bits for every two modes (compact.h)
 *                      MIXED  like INT16, but 16 words for every three of the last modes
 *     direction      48 numbers x y z x y z ...; none for vector fields
 *     reference      48 numbers x y z x y z ..., reference positions
 *
 * Tile t holds vertices 16 t to 16 t + 15; the last tile repeats the last vertex. Directions and
 * reference positions are floats (EXACT), or fixed-point numbers of which three share two words
 * (compact.h). The largest number determines their unit: within half a metre of the origin, a
 * position errs by at most 0.0005 mm in each coordinate. Once a frame, the weights are multiplied
 * by the units of coefficients and directions. */
#ifndef SUPINE_TILES_H
#define SUPINE_TILES_H

#include <supine/runtime.h>

enum {
  TILE = 16,         /**< number of vertices of a tile */
  TILE_NUMBERS = 48, /**< number of coordinates of a tile */
};

typedef struct supine_tiles {
  supine_storage storage;
  size_t modes;
  size_t axes;            /**< number of axes with coefficients: 3 for vector fields, else 1 */
  size_t axis_bytes;      /**< bytes of the coefficients of one axis in one tile */
  size_t direction_begin; /**< byte offset of the directions in a tile */
  size_t reference_begin; /**< byte offset of the reference positions in a tile */
  size_t stride;          /**< size of a tile in bytes */
  size_t count;
  /** Added to the bits of a float, this multiplies the float by the unit of reference positions. */
  uint32_t reference_unit;
  unsigned char *bytes; /**< [count, stride] bytes of the tiles */
} supine_tiles;

/** Return whether a storage is compact. In a compact storage, two or three coefficients share a
 * word, and directions and positions are fixed-point numbers. */
static inline bool supine_tiles_compact(supine_storage storage) {
  return storage != SUPINE_STORAGE_EXACT;
}

/** Return the number of words per vertex that hold three coefficients each. */
static inline size_t supine_tiles_thirds(supine_storage storage, size_t modes) {
  return storage == SUPINE_STORAGE_MIXED ? modes / 8 : 0;
}

/** Return the number of modes that are not in the words of supine_tiles_thirds. In a compact
 * storage, two of these modes share a word. */
static inline size_t supine_tiles_paired(supine_storage storage, size_t modes) {
  return modes - 3 * supine_tiles_thirds(storage, modes);
}

/** Fill in all members but `bytes` and `reference_unit` for a storage other than AUTO. The function
 * is inline, so that the layout is a constant where the number of modes is a constant. */
static inline void supine_tiles_layout(supine_tiles *tiles, supine_storage storage, size_t modes,
                                       bool vector, size_t count) {
  const bool compact = supine_tiles_compact(storage);
  const size_t thirds = supine_tiles_thirds(storage, modes);
  const size_t paired = supine_tiles_paired(storage, modes);
  const size_t line = 64;
  const size_t numbers = compact ? 2 * line : TILE_NUMBERS * sizeof(float);
  tiles->storage = storage;
  tiles->modes = modes;
  tiles->axes = vector ? 3 : 1;
  tiles->axis_bytes = line * (compact ? (paired + 1) / 2 + thirds : modes);
  tiles->direction_begin = tiles->axes * tiles->axis_bytes;
  tiles->reference_begin = tiles->direction_begin + (vector ? 0 : numbers);
  tiles->stride = tiles->reference_begin + numbers;
  tiles->count = count;
}

/** Return the number W of words for one coordinate of a normal. Word j holds modes j, j + W and j +
 * 2 W (compact.h), with 0 for modes that do not exist. */
static inline size_t supine_tiles_normal_words(size_t modes) {
  return (modes + 2) / 3;
}

/** Fill in the layout of tiles of normals. Each axis has supine_tiles_normal_words rows of 16
 * words. */
static inline void supine_tiles_layout_lit(supine_tiles *tiles, size_t modes, size_t count) {
  *tiles = (supine_tiles){.modes = modes, .axes = 3, .count = count};
  tiles->axis_bytes = TILE * sizeof(uint32_t) * supine_tiles_normal_words(modes);
  tiles->stride = 3 * tiles->axis_bytes;
}

typedef enum supine_prefetch {
  SUPINE_PREFETCH_NONE, /**< no prefetching, because the tiles are in the cache */
  SUPINE_PREFETCH_NEAR, /**< every other cache line, 640 bytes ahead, to the second-level cache */
  SUPINE_PREFETCH_FAR,  /**< every cache line, 8192 bytes ahead, without filling the outer caches */
} supine_prefetch;

/** Prefetch `stride` bytes at the distance after `tile` that `how` selects. */
static inline __attribute__((always_inline)) void
supine_prefetch_tile(const unsigned char *tile, size_t stride, supine_prefetch how) {
  enum { PAST_CACHES = 0, SECOND_LEVEL = 2 }; /* locality arguments of __builtin_prefetch */
  if (how == SUPINE_PREFETCH_NEAR) {
    for (size_t line = 0; line < stride; line += 128) {
      __builtin_prefetch(tile + 640 + line, 0, SECOND_LEVEL);
    }
  } else if (how == SUPINE_PREFETCH_FAR) {
    for (size_t line = 0; line < stride; line += 64) {
      __builtin_prefetch(tile + 8192 + line, 0, PAST_CACHES);
    }
  }
}

typedef struct supine_target {
  float *xyz;         /**< positions, displacements or normals of all vertices of the tiles */
  bool add_reference; /**< write positions, not displacements */
  bool stream;        /**< use stores that bypass the caches */
  supine_prefetch prefetch;
} supine_target;

/** Evaluate tiles first <= t < first + count of one lung, and write their vertices to the target.
 * @param weights  [modes + 3] weights times units (top of this file), then the gains of the lung
 * @param count    at least 1 */
typedef void supine_deform_tiles(const supine_tiles *tiles, const float *weights, size_t first,
                                 size_t count, const supine_target *target);

/** Make stores that bypass the caches visible to other threads. Call this after the last kernel. */
static inline void supine_stream_fence(bool stream) {
#if defined(__x86_64__)
  if (stream) {
    __builtin_ia32_sfence();
  }
#else
  (void)stream;
#endif
}

typedef struct supine_kernels {
  supine_deform_tiles *deform;
  /** Evaluate unit normals from tiles of supine_tiles_layout_lit. `weights` holds the weights of
   * the modes, followed by zeros up to a length of 3 times supine_tiles_normal_words. */
  supine_deform_tiles *light;
} supine_kernels;

extern const supine_kernels supine_kernels_portable;
extern const supine_kernels supine_kernels_avx2;   /**< members are NULL if built without AVX2 */
extern const supine_kernels supine_kernels_avx512; /**< members are NULL if built without AVX-512 */

/** Return the kernels of an instruction set, or NULL if the processor or the build lacks it.
 * Replace AUTO in *simd by the widest set of this processor. */
const supine_kernels *supine_kernels_choose(supine_simd *simd);

supine_prefetch supine_kernels_prefetch_choose(void);

#endif
