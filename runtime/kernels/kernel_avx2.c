/* SPDX-License-Identifier: MIT */
/* Evaluating tiles with AVX2 and FMA: two registers for the 16 vertices. */
#include "runtime/kernels/tiles.h"

#if defined(__AVX2__) && defined(__FMA__)
#include <immintrin.h>

#define INLINE static inline __attribute__((always_inline))

/* Coefficient 2 pair, or the one after it, of vertices 8 half to 8 half + 7. */
INLINE __m256 coefficient(const unsigned char *at, size_t pair, bool second, size_t half,
                          supine_storage storage) {
  if (supine_tiles_compact(storage)) {
    /* compact.h: pair_first, pair_second */
    const __m256i words = _mm256_load_si256((const __m256i *)(at + 64 * pair + 32 * half));
    return _mm256_cvtepi32_ps(second ? words : _mm256_slli_epi32(words, 16));
  }
  return _mm256_load_ps((const float *)(const void *)(at + 64 * (2 * pair + second) + 32 * half));
}

/* The coefficient of one of the three last modes whose words are `at` (compact.h). */
INLINE __m256 third_coefficient(const unsigned char *at, size_t which, size_t half) {
  const __m256i words = _mm256_load_si256((const __m256i *)(at + 32 * half));
  return _mm256_cvtepi32_ps(which == 0   ? words /* shifts take constants */
                            : which == 1 ? _mm256_slli_epi32(words, 11)
                                         : _mm256_slli_epi32(words, 22));
}

typedef struct halves {
  __m256 v[2];
} halves;

INLINE halves add_mode(halves sum, const unsigned char *at, const float *w, size_t pair,
                       bool second, supine_storage storage) {
  const __m256 weight = _mm256_broadcast_ss(w + 2 * pair + second);
  for (size_t half = 0; half < 2; ++half) {
    sum.v[half] =
        _mm256_fmadd_ps(weight, coefficient(at, pair, second, half, storage), sum.v[half]);
  }
  return sum;
}

INLINE halves add_thirds(halves sum, const unsigned char *words, const float *w) {
  for (size_t which = 0; which < 3; ++which) {
    const __m256 weight = _mm256_broadcast_ss(w + which);
    for (size_t half = 0; half < 2; ++half) {
      sum.v[half] = _mm256_fmadd_ps(weight, third_coefficient(words, which, half), sum.v[half]);
    }
  }
  return sum;
}

/* sum over k of w_k c_k: K multiplications, K - 1 additions. */
INLINE halves dot(const unsigned char *at, const float *w, size_t modes, supine_storage storage) {
  const __m256 first = _mm256_broadcast_ss(w);
  halves sum = {{_mm256_mul_ps(first, coefficient(at, 0, false, 0, storage)),
                 _mm256_mul_ps(first, coefficient(at, 0, false, 1, storage))}};
  const size_t paired = supine_tiles_paired(storage, modes);
  for (size_t pair = 0; pair < paired / 2; ++pair) {
    if (pair > 0) {
      sum = add_mode(sum, at, w, pair, false, storage);
    }
    sum = add_mode(sum, at, w, pair, true, storage);
  }
  if (paired > 1 && paired % 2 != 0) {
    sum = add_mode(sum, at, w, paired / 2, false, storage);
  }
  for (size_t k = paired; k < modes; k += 3) {
    sum = add_thirds(sum, at + supine_tiles_words_begin(paired, k), w + k);
  }
  return sum;
}

typedef struct triples {
  __m256 v[6];
} triples;

/* The numbers of a direction or rest position; compact ones in the unit they are packed in. */
INLINE triples numbers(const unsigned char *at, bool compact) {
  triples n;
  if (!compact) {
    for (size_t j = 0; j < 6; ++j) {
      n.v[j] = _mm256_load_ps((const float *)(const void *)(at + 32 * j));
    }
    return n;
  }
  for (size_t half = 0; half < 2; ++half) {
    const __m256i first = _mm256_load_si256((const __m256i *)(at + 32 * half));
    const __m256i second = _mm256_load_si256((const __m256i *)(at + 64 + 32 * half));
    const __m256i third = _mm256_or_si256(
        _mm256_slli_epi32(first, 21),
        _mm256_and_si256(_mm256_slli_epi32(second, 10), _mm256_set1_epi32(0x1FFC00)));
    n.v[half] = _mm256_cvtepi32_ps(first);
    n.v[2 + half] = _mm256_cvtepi32_ps(second);
    n.v[4 + half] = _mm256_cvtepi32_ps(third);
  }
  return n;
}

INLINE triples rest_positions(const supine_tiles *tiles, const unsigned char *tile, bool compact) {
  const __m256i unit = _mm256_set1_epi32((int)tiles->rest_unit);
  triples p = numbers(tile + tiles->rest_begin, compact);
  for (size_t j = 0; j < 6 && compact; ++j) {
    p.v[j] = _mm256_castsi256_ps(_mm256_add_epi32(_mm256_castps_si256(p.v[j]), unit));
  }
  return p;
}

/* a's lane of vertex i at numbers 3 i, 3 i + 1, 3 i + 2. */
INLINE triples spread_amount(halves a) {
  const __m256i lane[3] = {_mm256_setr_epi32(0, 0, 0, 1, 1, 1, 2, 2),
                           _mm256_setr_epi32(2, 3, 3, 3, 4, 4, 4, 5),
                           _mm256_setr_epi32(5, 5, 6, 6, 6, 7, 7, 7)};
  triples t;
  for (size_t j = 0; j < 6; ++j) {
    t.v[j] = _mm256_permutevar8x32_ps(a.v[j / 3], lane[j % 3]);
  }
  return t;
}

/* Eight of x, y, z to x y z x y z ...: each of the three is put in place, then blended. */
INLINE void interleave8(__m256 x, __m256 y, __m256 z, __m256 *out) {
  const __m256i lane[3] = {_mm256_setr_epi32(0, 0, 0, 1, 1, 1, 2, 2),
                           _mm256_setr_epi32(2, 3, 3, 3, 4, 4, 4, 5),
                           _mm256_setr_epi32(5, 5, 6, 6, 6, 7, 7, 7)};
  __m256 part[3][3];
  for (size_t j = 0; j < 3; ++j) {
    part[j][0] = _mm256_permutevar8x32_ps(x, lane[j]);
    part[j][1] = _mm256_permutevar8x32_ps(y, lane[j]);
    part[j][2] = _mm256_permutevar8x32_ps(z, lane[j]);
  }
  /* Bit b of a mask: lane b from the second. x y z x y z x y | z x y z x y z x | y z x y z x y z */
  out[0] = _mm256_blend_ps(_mm256_blend_ps(part[0][0], part[0][1], 0x92), part[0][2], 0x24);
  out[1] = _mm256_blend_ps(_mm256_blend_ps(part[1][0], part[1][1], 0x24), part[1][2], 0x49);
  out[2] = _mm256_blend_ps(_mm256_blend_ps(part[2][0], part[2][1], 0x49), part[2][2], 0x92);
}

/* Where the array is aligned to 16 bytes, as malloc gives it, a store past the cache goes in
 * halves: the processor joins them to lines. */
INLINE void put(float *to, __m256 v, bool stream) {
  if (!stream || (uintptr_t)to % 16 != 0) {
    _mm256_storeu_ps(to, v);
  } else if ((uintptr_t)to % 32 == 0) {
    _mm256_stream_ps(to, v);
  } else {
    _mm_stream_ps(to, _mm256_castps256_ps128(v));
    _mm_stream_ps(to + 4, _mm256_extractf128_ps(v, 1));
  }
}

/* x y z over their length: the estimate of the inverse root has 12 bits, Newton's step doubles
 * them. The smallest normal number keeps 0 from becoming NaN. */
INLINE void normalise(__m256 *x, __m256 *y, __m256 *z) {
  const __m256 square =
      _mm256_max_ps(_mm256_fmadd_ps(*x, *x, _mm256_fmadd_ps(*y, *y, _mm256_mul_ps(*z, *z))),
                    _mm256_set1_ps(0x1p-126F));
  const __m256 guess = _mm256_rsqrt_ps(square);
  const __m256 error = _mm256_fnmadd_ps(_mm256_mul_ps(square, guess), guess, _mm256_set1_ps(1));
  const __m256 inverse = _mm256_fmadd_ps(_mm256_mul_ps(guess, error), _mm256_set1_ps(0.5F), guess);
  *x = _mm256_mul_ps(*x, inverse);
  *y = _mm256_mul_ps(*y, inverse);
  *z = _mm256_mul_ps(*z, inverse);
}

/* The gains x y z x y z ... of eight numbers at a time. */
INLINE triples spread_gains(const float *g) {
  triples t;
  for (size_t j = 0; j < 6; ++j) {
    const float *a = g + 2 * j % 3; /* 8 j mod 3 */
    const float *b = g + (2 * j + 1) % 3;
    const float *c = g + (2 * j + 2) % 3;
    t.v[j] = _mm256_setr_ps(*a, *b, *c, *a, *b, *c, *a, *b);
  }
  return t;
}

INLINE triples deform_tile(const supine_tiles *tiles, const unsigned char *tile, const float *w,
                           const triples *gain, bool with_rest, supine_storage storage,
                           bool vector) {
  const bool compact = supine_tiles_compact(storage);
  triples result;
  if (vector) {
    const halves x = dot(tile, w, tiles->modes, storage);
    const halves y = dot(tile + tiles->axis_bytes, w, tiles->modes, storage);
    const halves z = dot(tile + 2 * tiles->axis_bytes, w, tiles->modes, storage);
    interleave8(x.v[0], y.v[0], z.v[0], result.v);
    interleave8(x.v[1], y.v[1], z.v[1], result.v + 3);
    if (with_rest) {
      const triples rest = rest_positions(tiles, tile, compact);
      for (size_t j = 0; j < 6; ++j) {
        result.v[j] = _mm256_fmadd_ps(result.v[j], gain->v[j], rest.v[j]);
      }
      return result;
    }
    for (size_t j = 0; j < 6; ++j) {
      result.v[j] = _mm256_mul_ps(result.v[j], gain->v[j]);
    }
    return result;
  }
  const triples amount = spread_amount(dot(tile, w, tiles->modes, storage));
  triples direction = numbers(tile + tiles->direction_begin, compact);
  for (size_t j = 0; j < 6; ++j) {
    direction.v[j] = _mm256_mul_ps(direction.v[j], gain->v[j]);
  }
  if (with_rest) {
    const triples rest = rest_positions(tiles, tile, compact);
    for (size_t j = 0; j < 6; ++j) {
      result.v[j] = _mm256_fmadd_ps(amount.v[j], direction.v[j], rest.v[j]);
    }
  } else {
    for (size_t j = 0; j < 6; ++j) {
      result.v[j] = _mm256_mul_ps(amount.v[j], direction.v[j]);
    }
  }
  return result;
}

/* Numbers of three arrays; this form is not worth shuffles of its own. */
INLINE void put_separate(const triples *t, const supine_target *target, size_t at) {
  float xyz[TILE_NUMBERS];
  for (size_t j = 0; j < 6; ++j) {
    _mm256_storeu_ps(xyz + 8 * j, t->v[j]);
  }
  for (size_t v = 0; v < TILE; ++v) {
    target->x[at + v] = xyz[3 * v];
    target->y[at + v] = xyz[3 * v + 1];
    target->z[at + v] = xyz[3 * v + 2];
  }
}

INLINE void deform_kind(const supine_tiles *tiles, const float *weights, size_t first, size_t count,
                        const supine_target *target, supine_storage storage, bool vector) {
  const unsigned char *tile = tiles->bytes + first * tiles->stride;
  const triples gain = spread_gains(weights + tiles->modes);
  for (size_t t = 0; t < count; ++t, tile += tiles->stride) {
    supine_prefetch_tile(tile, tiles->stride, target->prefetch);
    const triples xyz = deform_tile(tiles, tile, weights, &gain, target->rest, storage, vector);
    if (target->y != NULL) {
      put_separate(&xyz, target, t * TILE);
      continue;
    }
    for (size_t j = 0; j < 6; ++j) {
      put(target->x + t * TILE_NUMBERS + 8 * j, xyz.v[j], target->stream);
    }
  }
}

/* Modes that words begin, that they hold second and third: compact.h. */
INLINE __m256 normal_mode(__m256i words, size_t which) {
  return _mm256_cvtepi32_ps(which == 0   ? words /* shifts take constants */
                            : which == 1 ? _mm256_slli_epi32(words, 13)
                                         : _mm256_slli_epi32(words, 23));
}

/* A normal along one axis, before its length is taken out: a chain for each place in the words. */
INLINE __m256 dot_normal(const unsigned char *at, const float *w, size_t words) {
  __m256 sum[3] = {_mm256_setzero_ps(), _mm256_setzero_ps(), _mm256_setzero_ps()};
  for (size_t j = 0; j < words; ++j) {
    const __m256i word = _mm256_load_si256((const __m256i *)(at + 64 * j));
    for (size_t which = 0; which < 3; ++which) {
      sum[which] = _mm256_fmadd_ps(_mm256_broadcast_ss(w + which * words + j),
                                   normal_mode(word, which), sum[which]);
    }
  }
  return _mm256_add_ps(_mm256_add_ps(sum[0], sum[1]), sum[2]);
}

INLINE void light_words(const supine_tiles *tiles, const float *weights, size_t first, size_t count,
                        const supine_target *target, size_t words) {
  const size_t axis_bytes = 64 * words;
  const unsigned char *tile = tiles->bytes + first * 3 * axis_bytes;
  for (size_t t = 0; t < count; ++t, tile += 3 * axis_bytes) {
    supine_prefetch_tile(tile, 3 * axis_bytes, target->prefetch);
    for (size_t half = 0; half < 2; ++half) {
      const unsigned char *at = tile + 32 * half;
      __m256 x = dot_normal(at, weights, words);
      __m256 y = dot_normal(at + axis_bytes, weights, words);
      __m256 z = dot_normal(at + 2 * axis_bytes, weights, words);
      __m256 xyz[3];
      normalise(&x, &y, &z);
      interleave8(x, y, z, xyz);
      for (size_t j = 0; j < 3; ++j) {
        put(target->x + t * TILE_NUMBERS + 24 * half + 8 * j, xyz[j], target->stream);
      }
    }
  }
}

INLINE void widen_coefficients(const unsigned char *at, size_t modes, supine_storage storage,
                               float *c) {
  const size_t paired = supine_tiles_paired(storage, modes);
  for (size_t k = 0; k < paired; ++k) {
    _mm256_store_ps(c + 16 * k, coefficient(at, k / 2, k % 2 != 0, 0, storage));
    _mm256_store_ps(c + 16 * k + 8, coefficient(at, k / 2, k % 2 != 0, 1, storage));
  }
  for (size_t k = paired; k < modes; ++k) {
    const unsigned char *words = at + supine_tiles_words_begin(paired, k);
    _mm256_store_ps(c + 16 * k, third_coefficient(words, (k - paired) % 3, 0));
    _mm256_store_ps(c + 16 * k + 8, third_coefficient(words, (k - paired) % 3, 1));
  }
}

INLINE void store(triples t, float *to) {
  for (size_t j = 0; j < 6; ++j) {
    _mm256_store_ps(to + 8 * j, t.v[j]);
  }
}

#include "runtime/kernels/instances.h"

const supine_kernels supine_kernels_avx2 = {deform, light, widen};
#else
const supine_kernels supine_kernels_avx2 = {NULL, NULL, NULL};
#endif
