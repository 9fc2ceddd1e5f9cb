/* SPDX-License-Identifier: MIT */
/** @file
 * A basis as the evaluator reads it: tiles of 16 vertices, each one run of whole cache lines.
 *
 *     coefficients   for each axis (1, or 3 where the kind is vector)
 *                      EXACT            16 floats a mode
 *                      INT16            16 words of 32 bits for two modes, see compact.h
 *                      MIXED            the same, but 16 words for three of the last modes
 *     direction      48 numbers x y z x y z ...; none where the kind is vector
 *     rest           48 numbers x y z x y z ...
 *
 * Tile t holds vertices 16 t to 16 t + 15, the last filled up with its last vertex. The numbers of
 * directions and rest positions are floats (EXACT), or three to two words (compact.h): fixed point,
 * in a unit that suits the largest. A rest position within half a metre of the origin errs by at
 * most 0.0005 mm in each coordinate. The units of coefficients and directions are folded into the
 * weights, so they cost nothing. */
#ifndef SUPINE_TILES_H
#define SUPINE_TILES_H

#include <supine/runtime.h>

enum {
  TILE = 16,         /**< vertices */
  TILE_NUMBERS = 48, /**< their coordinates */
};

typedef struct supine_tiles {
  supine_storage storage;
  size_t modes;
  size_t axes;            /**< 1, or 3 where the kind is vector */
  size_t axis_bytes;      /**< coefficients of one axis in one tile */
  size_t direction_begin; /**< byte offsets in the tile */
  size_t rest_begin;
  size_t stride; /**< bytes from tile to tile */
  size_t count;
  uint32_t rest_unit; /**< of compact rest positions: a power of two, to add to a float's bits */
  unsigned char *bytes;
} supine_tiles;

/** Does the storage share words: two or three coefficients a word, directions and rest positions
 * compact? */
static inline bool supine_tiles_compact(supine_storage storage) {
  return storage != SUPINE_STORAGE_EXACT;
}

/** How many words of a vertex hold three of the last coefficients each. */
static inline size_t supine_tiles_thirds(supine_storage storage, size_t modes) {
  return storage == SUPINE_STORAGE_MIXED ? modes / 8 : 0;
}

/** How many modes come before those: two to a word where words are shared at all. */
static inline size_t supine_tiles_paired(supine_storage storage, size_t modes) {
  return modes - 3 * supine_tiles_thirds(storage, modes);
}

/** Where the words of mode k begin, bytes from the first mode's, in a storage that shares them. */
static inline size_t supine_tiles_words_begin(size_t paired, size_t k) {
  return 64 * (k < paired ? k / 2 : (paired + 1) / 2 + (k - paired) / 3);
}

/** Fills in the layout for a storage (never AUTO): offsets, stride; not bytes. Inline, so that a
 * kernel's constants fold. */
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
  tiles->rest_begin = tiles->direction_begin + (vector ? 0 : numbers);
  tiles->stride = tiles->rest_begin + numbers;
  tiles->count = count;
}

/** How many words hold the modes of a normal along one axis: word j modes j, j + words and
 * j + 2 words (compact.h), missing ones 0. */
static inline size_t supine_tiles_normal_words(size_t modes) {
  return (modes + 2) / 3;
}

/** The layout of tiles of normals: 16 words for each word of each axis, and nothing else. */
static inline void supine_tiles_layout_lit(supine_tiles *tiles, size_t modes, size_t count) {
  *tiles = (supine_tiles){.modes = modes, .axes = 3, .count = count};
  tiles->axis_bytes = TILE * sizeof(uint32_t) * supine_tiles_normal_words(modes);
  tiles->stride = 3 * tiles->axis_bytes;
}

/** How to ask for tiles that come from memory ahead of their use. */
typedef enum supine_prefetch {
  SUPINE_PREFETCH_NONE, /**< they are in the cache */
  SUPINE_PREFETCH_NEAR, /**< every other line, 640 bytes ahead, to the second-level cache */
  SUPINE_PREFETCH_FAR,  /**< every line, 8192 bytes ahead, past the caches */
} supine_prefetch;

/** Asks for what lies ahead of a tile of `stride` bytes. */
static inline __attribute__((always_inline)) void
supine_prefetch_tile(const unsigned char *tile, size_t stride, supine_prefetch how) {
  enum { PAST_CACHES = 0, SECOND_LEVEL = 2 }; /* of the builtin */
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

/** Where and how a kernel writes. Either one array of triples (x, with y NULL) or three arrays. */
typedef struct supine_target {
  float *x, *y, *z;
  bool rest;   /**< positions; otherwise displacements alone */
  bool stream; /**< store past the cache */
  supine_prefetch prefetch;
  /** [16] or NULL. Where one array is written in several runs, what one run leaves to the next, so
   * that a line that both share is stored once. */
  float *held;
  bool continues; /**< a run before this one left numbers in `held` */
  bool continued; /**< leave such numbers for a run after this one */
} supine_target;

/** Evaluates whole tiles first <= t < first + count, of one lung, from folded weights and gains
 * (see supine_fold), into the first 16 count vertices of the target. */
typedef void supine_deform_tiles(const supine_tiles *tiles, const float *weights, size_t first,
                                 size_t count, const supine_target *target);

/** Makes stores past the cache visible to other threads in order; after the last kernel of a call.
 */
static inline void supine_stream_fence(bool stream) {
#if defined(__x86_64__)
  if (stream) {
    __builtin_ia32_sfence();
  }
#else
  (void)stream;
#endif
}

/** Widens tiles first <= t < first + count into the EXACT layout `to`, keeping the units of the
 * packed coefficients, so that the same folded weights serve. */
typedef void supine_widen_tiles(const supine_tiles *tiles, size_t first, size_t count,
                                supine_tiles *to);

typedef struct supine_kernels {
  supine_deform_tiles *deform;
  /** Vectors of length 1 from tiles of supine_tiles_layout_lit into one array; three weights for
   * each of its words, in the order of the modes. */
  supine_deform_tiles *light;
  supine_widen_tiles *widen;
} supine_kernels;

extern const supine_kernels supine_kernels_portable;
extern const supine_kernels supine_kernels_avx2;   /**< NULLs where not built */
extern const supine_kernels supine_kernels_avx512; /**< NULLs where not built */

/** The code of the given kind, or of the widest kind where AUTO (then *simd says which); NULL where
 * this processor or build has not got it. */
const supine_kernels *supine_kernels_choose(supine_simd *simd);

/** What serves this processor best. */
supine_prefetch supine_kernels_prefetch_choose(void);

#endif
