/* SPDX-License-Identifier: MIT */
/** @file
 * Layout of a basis in memory for the kernels: tiles of 16 vertices, each of whole cache lines.
 *
 *     coefficients   of each mode at the 16 vertices; in vector fields, those on x, then y, then z
 *     direction      48 numbers x y z x y z ..., directions of displacement; not in vector fields
 *     reference      48 numbers x y z x y z ..., reference positions
 *
 * Tile t holds vertices 16 t to 16 t + 15; the last tile repeats the last vertex. The storage
 * determines the types of numbers:
 *
 *     EXACT  floats
 *     INT16  32-bit words (compact.h): one for two coefficients, two for three coordinates
 *     MIXED  like INT16, but one word for three coefficients of the last modes
 *
 * Integers count quantisation steps, which are so large that the largest number just fits. Within
 * half a metre of the origin, a reference position errs by at most 0.0005 mm in each coordinate.
 * Once a frame, the weights are multiplied by the steps of coefficients and directions. */
#ifndef SUPINE_TILES_H
#define SUPINE_TILES_H

#include <supine/runtime.h>

enum {
  TILE = 16,         /**< number of vertices of a tile */
  TILE_NUMBERS = 48, /**< number of coordinates of the vertices of a tile */
};

typedef struct supine_tiles {
  supine_storage storage;
  size_t modes;
  size_t axes;       /**< number of coefficients per vertex and mode: 3 in vector fields, else 1 */
  size_t axis_bytes; /**< bytes of the coefficients of one axis in one tile */
  size_t direction_begin; /**< byte offset of the directions in a tile */
  size_t reference_begin; /**< byte offset of the reference positions in a tile */
  size_t stride;          /**< size of a tile in bytes */
  size_t count;
  /** Exponent of the quantisation step of reference positions, shifted to the exponent bits of a
   * float: adding it to the bits of a float multiplies the float by the step. */
  uint32_t reference_unit;
  unsigned char *bytes;
} supine_tiles;

/** Return whether a storage packs two or three coefficients into a word, and stores directions and
 * positions as fixed-point numbers. */
static inline bool supine_tiles_compact(supine_storage storage) {
  return storage != SUPINE_STORAGE_EXACT;
}

/** Return the number of 32-bit words per vertex that hold the coefficients of three modes each. */
static inline size_t supine_tiles_thirds(supine_storage storage, size_t modes) {
  return storage == SUPINE_STORAGE_MIXED ? modes / 8 : 0;
}

/** Return the number of modes whose coefficients do not share a word by threes. In compact
 * storages, the coefficients of two of these modes share a word. */
static inline size_t supine_tiles_paired(supine_storage storage, size_t modes) {
  return modes - 3 * supine_tiles_thirds(storage, modes);
}

/** Fill in all members but `bytes` and `reference_unit` for a storage other than AUTO. The function
 * is inline, so that the layout is a constant for a constant number of modes. */
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

/** Return the number W of 32-bit words for one coordinate of the vectors whose weighted sum is a
 * normal. Word j holds vectors j, j + W and j + 2 W (compact.h), with 0 for absent vectors. */
static inline size_t supine_tiles_normal_words(size_t modes) {
  return (modes + 2) / 3;
}

/** Fill in the layout of tiles that hold the vectors of normals. For each axis, a tile has
 * supine_tiles_normal_words words for each of its 16 vertices.
 * @param modes  number of vectors of a normal */
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

/** Prefetch `stride` bytes at a distance after `tile`. `how` selects the distance. */
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
  float *xyz; /**< positions, displacements or normals of all vertices of the tiles, written */
  bool add_reference; /**< true: write positions; false: write displacements */
  bool stream;        /**< whether to use stores that bypass the caches */
  supine_prefetch prefetch;
} supine_target;

/** Evaluate tiles first <= t < first + count of one lung, and write their vertices to the target.
 * @param scales  [modes + 3] weight of each mode, times the quantisation steps of coefficients
 *                 and directions; then the three gains of the lung (factors of its displacement)
 * @param count    at least 1 */
typedef void supine_deform_tiles(const supine_tiles *tiles, const float *scales, size_t first,
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
  /** Evaluate unit normals from packed vectors (supine_tiles_layout_lit). `scales` holds the
   * weight of each vector, padded with zeros to a multiple of three. */
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
