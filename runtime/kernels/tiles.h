/* SPDX-License-Identifier: MIT */
/** @file
 * Layout of a basis in memory for the kernels. A tile holds 16 vertices in whole cache lines:
 *
 *     coefficients   [axes, modes, 16]; 3 axes if supine_basis_info.vector is true, otherwise 1
 *     direction      [16, 3] vectors along which the vertices move; absent with 3 axes
 *     reference      [16, 3] reference positions
 *
 * Tile t holds vertices 16 t to 16 t + 15; the last tile repeats the last vertex. The storage
 * determines the types of numbers:
 *
 *     EXACT  floats
 *     INT16  32-bit words (compact.h): one for two coefficients, two for three coordinates
 *     MIXED  like INT16, but one word for three coefficients of the last 3 floor(K / 8) of K modes
 *
 * A basis of clusters has other tiles. A vertex is four words: its reference position as floats,
 * and its two scalars as 16-bit integers of one word; then follow the 16-bit indices of the 16
 * clusters.
 *
 * Integers count quantisation steps. A step is as small as the largest number allows. Within half a
 * metre of the origin, a reference position errs by at most 0.0005 mm in each coordinate. Once a
 * frame, the weights of modes are multiplied by the steps of coefficients and directions. */
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
  size_t axes;       /**< coefficients per vertex and mode: 3 (x, y, z), or 1 along the direction */
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

/** Return how many of the 32-bit words with the coefficients of a vertex hold three of them. */
static inline size_t supine_tiles_thirds(supine_storage storage, size_t modes) {
  return storage == SUPINE_STORAGE_MIXED ? modes / 8 : 0;
}

/** Return the number of modes whose coefficients are not packed three to a word. Compact storages
 * pack these two to a word. */
static inline size_t supine_tiles_paired(supine_storage storage, size_t modes) {
  return modes - 3 * supine_tiles_thirds(storage, modes);
}

/** Fill in all members but `bytes` and `reference_unit`; `storage` is not AUTO. This function is
 * inline so that the compiler can compute the layout if `modes` is a constant. */
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

/** Return the number W of 32-bit words that hold one coordinate of all vectors of a vertex
 * (supine_basis_info.normals). Word j holds vectors j, j + W and j + 2 W, or 0 past the last. */
static inline size_t supine_tiles_normal_words(size_t vectors) {
  return (vectors + 2) / 3;
}

/** Fill in the layout of tiles of supine_basis_info.normals. For each axis, a tile has
 * supine_tiles_normal_words words for each of its 16 vertices.
 * @param vectors  number of vectors per vertex, whose weighted sum is the normal */
static inline void supine_tiles_layout_lit(supine_tiles *tiles, size_t vectors, size_t count) {
  *tiles = (supine_tiles){.modes = vectors, .axes = 3, .count = count};
  tiles->axis_bytes = TILE * sizeof(uint32_t) * supine_tiles_normal_words(vectors);
  tiles->stride = 3 * tiles->axis_bytes;
}

/** Numbers of a cluster in a pose, four words each so that one load fetches them: b, the columns of
 * A, Q_0 and Q_1 (runtime/clusters.h). The fourth number of each is not used. */
enum { SUPINE_CLUSTER_FRAME = 24 };

/** Fill in the layout of tiles of a basis of clusters. */
static inline void supine_tiles_layout_clusters(supine_tiles *tiles, size_t count) {
  *tiles = (supine_tiles){.axes = 3, .count = count};
  tiles->reference_begin = TILE * 4 * sizeof(float); /* of the indices */
  tiles->stride = tiles->reference_begin + TILE * sizeof(uint16_t);
}

typedef enum supine_prefetch {
  SUPINE_PREFETCH_NONE, /**< no prefetching, because the tiles are in the cache */
  SUPINE_PREFETCH_NEAR, /**< every other cache line, 640 bytes ahead, to the second-level cache */
  SUPINE_PREFETCH_FAR,  /**< every cache line, 8192 bytes ahead, without filling the outer caches */
} supine_prefetch;

/** Prefetch `stride` bytes of a later tile, at the distance given by `how`. */
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

/** Evaluate tiles first <= t < first + count of one lung, 16 vertices each, into the target.
 * @param scales  [modes + 3] weight of each mode times supine_basis.mode_scale; then the factors of
 *                 the lung's displacement along x, y and z
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
  /** Evaluate vertices of clusters (supine_tiles_layout_clusters). `scales` holds the clusters,
   * [clusters, SUPINE_CLUSTER_FRAME]. */
  supine_deform_tiles *cluster;
} supine_kernels;

extern const supine_kernels supine_kernels_portable;
extern const supine_kernels supine_kernels_avx2;   /**< members are NULL if built without AVX2 */
extern const supine_kernels supine_kernels_avx512; /**< members are NULL if built without AVX-512 */

/** Return the kernels of an instruction set, or NULL if the processor or the build lacks it.
 * Replace AUTO in *simd by the set that the environment variable SUPINE_SIMD names, which may be
 * none (COUNT), or by the widest set of this processor. */
const supine_kernels *supine_kernels_choose(supine_simd *simd);

supine_prefetch supine_kernels_prefetch_choose(void);

#endif
