/* SPDX-License-Identifier: MIT */
/* Evaluating tiles four numbers at a time, in the vectors that gcc and clang have for every
 * processor: SSE2, NEON, WebAssembly's 128 bits. */
#include "runtime/kernels/compact.h"
#include "runtime/kernels/tiles.h"

#if defined(__has_builtin)
#if __has_builtin(__builtin_shufflevector)
#define HAS_VECTORS
#endif
#endif

#ifdef HAS_VECTORS
#define INLINE static inline __attribute__((always_inline))

typedef float v4 __attribute__((vector_size(16)));
typedef int32_t i4 __attribute__((vector_size(16)));
typedef uint32_t u4 __attribute__((vector_size(16)));

/* One number of each of 16 vertices. */
typedef struct row {
  v4 v[4];
} row;

typedef struct triples {
  v4 v[12];
} triples;

INLINE v4 load(const void *from) {
  v4 v;
  memcpy(&v, from, sizeof v);
  return v;
}

INLINE u4 load_words(const unsigned char *from) {
  u4 v;
  memcpy(&v, from, sizeof v);
  return v;
}

INLINE void put(float *to, v4 v) {
  memcpy(to, &v, sizeof v);
}

/* Words as the signed integers that they stand for (compact.h). */
INLINE v4 integers(u4 words) {
  return __builtin_convertvector((i4)words, v4);
}

/* sum += w x the numbers that begin `shift` bits below the top of 16 words. */
INLINE row add_words(row sum, const unsigned char *at, float w, int shift) {
  for (size_t q = 0; q < 4; ++q) {
    sum.v[q] += w * integers(load_words(at + 16 * q) << shift);
  }
  return sum;
}

/* sum over k of w_k c_k of 16 vertices. */
INLINE row dot(const supine_tiles *tiles, const unsigned char *at, const float *w, bool compact) {
  const size_t paired = supine_tiles_paired(tiles->storage, tiles->modes);
  row sum = {{{0}}};
  if (!compact) {
    for (size_t k = 0; k < tiles->modes; ++k, at += 64) {
      for (size_t q = 0; q < 4; ++q) {
        sum.v[q] += w[k] * load(at + 16 * q);
      }
    }
    return sum;
  }
  for (size_t k = 0; k < paired; k += 2, at += 64) {
    sum = add_words(sum, at, w[k], 16);
    sum = k + 1 < paired ? add_words(sum, at, w[k + 1], 0) : sum;
  }
  for (size_t k = paired; k < tiles->modes; k += 3, at += 64) {
    sum = add_words(sum, at, w[k], 0);
    sum = add_words(sum, at, w[k + 1], 11);
    sum = add_words(sum, at, w[k + 2], 22);
  }
  return sum;
}

/* The numbers of a direction or rest position; compact ones in the unit they are packed in. */
INLINE triples numbers(const unsigned char *at, bool compact) {
  triples n;
  for (size_t j = 0; j < 12 && !compact; ++j) {
    n.v[j] = load(at + 16 * j);
  }
  for (size_t q = 0; q < 4 && compact; ++q) {
    const u4 first = load_words(at + 16 * q);
    const u4 second = load_words(at + 64 + 16 * q);
    n.v[q] = integers(first);
    n.v[4 + q] = integers(second);
    n.v[8 + q] = integers(first << 21 | (second << 10 & 0x1FFC00));
  }
  return n;
}

INLINE triples rest_positions(const supine_tiles *tiles, const unsigned char *tile, bool compact) {
  triples p = numbers(tile + tiles->rest_begin, compact);
  for (size_t j = 0; j < 12 && compact; ++j) {
    p.v[j] = (v4)((u4)p.v[j] + tiles->rest_unit);
  }
  return p;
}

/* Four of x, y, z to x y z x y z ... */
INLINE void interleave4(v4 x, v4 y, v4 z, v4 *out) {
  const v4 xy = __builtin_shufflevector(x, y, 0, 4, 1, 5);
  const v4 yz = __builtin_shufflevector(y, z, 1, 5, 2, 6);
  const v4 zx = __builtin_shufflevector(z, x, 2, 7, 3, 0);
  out[0] = __builtin_shufflevector(xy, z, 0, 1, 4, 2);
  out[1] = __builtin_shufflevector(yz, x, 0, 1, 6, 2);
  out[2] = __builtin_shufflevector(zx, y, 0, 1, 7, 2);
}

/* The 48 coordinates of 16 vertices. */
INLINE triples interleave(row x, row y, row z) {
  triples t;
  for (size_t q = 0; q < 4; ++q) {
    interleave4(x.v[q], y.v[q], z.v[q], t.v + 3 * q);
  }
  return t;
}

INLINE triples deform_tile(const supine_tiles *tiles, const unsigned char *tile, const float *w,
                           bool with_rest, bool compact) {
  const float *g = w + tiles->modes;
  const v4 gain[3] = {{g[0], g[1], g[2], g[0]}, {g[1], g[2], g[0], g[1]}, {g[2], g[0], g[1], g[2]}};
  const row x = dot(tiles, tile, w, compact);
  triples t;
  if (tiles->axes == 3) {
    const row y = dot(tiles, tile + tiles->axis_bytes, w, compact);
    t = interleave(x, y, dot(tiles, tile + 2 * tiles->axis_bytes, w, compact));
  } else {
    const triples d = numbers(tile + tiles->direction_begin, compact);
    t = interleave(x, x, x);
    for (size_t j = 0; j < 12; ++j) {
      t.v[j] *= d.v[j];
    }
  }
  const triples p = with_rest ? rest_positions(tiles, tile, compact) : (triples){{{0}}};
  for (size_t j = 0; j < 12; ++j) {
    t.v[j] = p.v[j] + gain[j % 3] * t.v[j];
  }
  return t;
}

INLINE void store(triples t, float *to) {
  for (size_t j = 0; j < 12; ++j) {
    put(to + 4 * j, t.v[j]);
  }
}

INLINE void deform_tiles(const supine_tiles *tiles, const float *weights, size_t first,
                         size_t count, const supine_target *target, bool compact) {
  const unsigned char *tile = tiles->bytes + first * tiles->stride;
  for (size_t t = 0; t < count; ++t, tile += tiles->stride) {
    const triples xyz = deform_tile(tiles, tile, weights, target->rest, compact);
    if (target->y == NULL) {
      store(xyz, target->x + t * TILE_NUMBERS);
      continue;
    }
    float apart[TILE_NUMBERS];
    store(xyz, apart);
    for (size_t v = 0; v < TILE; ++v) {
      target->x[t * TILE + v] = apart[3 * v];
      target->y[t * TILE + v] = apart[3 * v + 1];
      target->z[t * TILE + v] = apart[3 * v + 2];
    }
  }
}

static void deform(const supine_tiles *tiles, const float *weights, size_t first, size_t count,
                   const supine_target *target) {
  if (supine_tiles_compact(tiles->storage)) {
    deform_tiles(tiles, weights, first, count, target, true);
  } else {
    deform_tiles(tiles, weights, first, count, target, false);
  }
}

/* Normals of four vertices along one axis, before their lengths are taken out. */
INLINE v4 dot_normal(const unsigned char *at, const float *w, size_t words) {
  v4 sum[3] = {{0}, {0}, {0}};
  for (size_t j = 0; j < words; ++j, at += 64) {
    const u4 word = load_words(at);
    sum[0] += w[j] * integers(word);
    sum[1] += w[words + j] * integers(word << 13);
    sum[2] += w[2 * words + j] * integers(word << 23);
  }
  return sum[0] + sum[1] + sum[2];
}

static void light(const supine_tiles *tiles, const float *weights, size_t first, size_t count,
                  const supine_target *target) {
  const size_t words = supine_tiles_normal_words(tiles->modes);
  const size_t axis_bytes = 64 * words;
  const unsigned char *at = tiles->bytes + first * 3 * axis_bytes;
  float *to = target->x;
  for (size_t t = 0; t < count; ++t, at += 3 * axis_bytes) {
    for (size_t q = 0; q < 4; ++q, to += 12) {
      const v4 x = dot_normal(at + 16 * q, weights, words);
      const v4 y = dot_normal(at + axis_bytes + 16 * q, weights, words);
      const v4 z = dot_normal(at + 2 * axis_bytes + 16 * q, weights, words);
      /* The smallest normal number keeps 0 from becoming NaN. */
      const v4 square = x * x + y * y + z * z + 0x1p-126F;
      const v4 length = {sqrtf(square[0]), sqrtf(square[1]), sqrtf(square[2]), sqrtf(square[3])};
      v4 xyz[3];
      interleave4(x / length, y / length, z / length, xyz);
      for (size_t j = 0; j < 3; ++j) {
        put(to + 4 * j, xyz[j]);
      }
    }
  }
}

/* Compact coefficients of one axis as floats. */
static void widen_coefficients(const supine_tiles *tiles, const unsigned char *at, float *c) {
  const size_t paired = supine_tiles_paired(tiles->storage, tiles->modes);
  for (size_t k = 0; k < tiles->modes; ++k) {
    const int shift = k >= paired ? 11 * (int)((k - paired) % 3) : k % 2 == 0 ? 16 : 0;
    for (size_t q = 0; q < 4; ++q, c += 4) {
      put(c, integers(load_words(at + supine_tiles_words_begin(paired, k) + 16 * q) << shift));
    }
  }
}

static void widen(const supine_tiles *tiles, size_t first, size_t count, supine_tiles *to) {
  for (size_t t = 0; t < count; ++t) {
    const unsigned char *tile = tiles->bytes + (first + t) * tiles->stride;
    unsigned char *wide = to->bytes + t * to->stride;
    if (!supine_tiles_compact(tiles->storage)) {
      memcpy(wide, tile, tiles->stride); /* the layout is the same */
      continue;
    }
    for (size_t axis = 0; axis < tiles->axes; ++axis) {
      widen_coefficients(tiles, tile + axis * tiles->axis_bytes,
                         (float *)(void *)(wide + axis * to->axis_bytes));
    }
    if (tiles->axes == 1) {
      store(numbers(tile + tiles->direction_begin, true),
            (float *)(void *)(wide + to->direction_begin));
    }
    store(rest_positions(tiles, tile, true), (float *)(void *)(wide + to->rest_begin));
  }
}

const supine_kernels supine_kernels_vector128 = {deform, light, widen};
#else
const supine_kernels supine_kernels_vector128 = {NULL, NULL, NULL};
#endif
