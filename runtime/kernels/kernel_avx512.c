/* SPDX-License-Identifier: MIT */
/* Evaluating tiles with AVX-512 F and BW: one register for the 16 vertices. */
#include "runtime/kernels/tiles.h"

#if defined(__AVX512F__) && defined(__AVX512BW__)
#include <immintrin.h>

#define INLINE static inline __attribute__((always_inline))
/* Where the trip count is known, all of it, so that an array of registers is one. */
#if defined(__clang__)
#define UNROLL _Pragma("clang loop unroll_count(16)")
#else
#define UNROLL _Pragma("GCC unroll 16")
#endif

enum { COMMON_MODES = 16 }; /* whose weights stay in registers */

/* Weight k in every lane: from a register where the number of modes is the common one. */
typedef struct weights16 {
  const float *at;
  __m512 v[COMMON_MODES];
} weights16;

INLINE __m512 weight(const weights16 *w, size_t k, bool common) {
  return common ? w->v[k] : _mm512_set1_ps(w->at[k]);
}

/* Coefficient 2 pair, or the one after it, of 16 vertices. */
INLINE __m512 coefficient(const unsigned char *at, size_t pair, bool second,
                          supine_storage storage) {
  if (supine_tiles_compact(storage)) {
    /* compact.h: pair_first, pair_second */
    const __m512i words = _mm512_load_si512(at + 64 * pair);
    return _mm512_cvtepi32_ps(second ? words : _mm512_slli_epi32(words, 16));
  }
  return _mm512_load_ps(at + 64 * (2 * pair + second));
}

/* The coefficient of one of the three last modes whose words are `at` (compact.h). */
INLINE __m512 third_coefficient(const unsigned char *at, size_t which) {
  const __m512i words = _mm512_load_si512(at);
  return _mm512_cvtepi32_ps(which == 0   ? words /* shifts take constants */
                            : which == 1 ? _mm512_slli_epi32(words, 11)
                                         : _mm512_slli_epi32(words, 22));
}

/* sum over k of w_k c_k, in two chains: K multiplications, K - 1 additions. */
INLINE __m512 dot(const unsigned char *at, const weights16 *w, size_t modes, bool common,
                  supine_storage storage) {
  __m512 even = _mm512_mul_ps(weight(w, 0, common), coefficient(at, 0, false, storage));
  if (modes == 1) {
    return even;
  }
  __m512 odd = _mm512_mul_ps(weight(w, 1, common), coefficient(at, 0, true, storage));
  const size_t thirds = supine_tiles_thirds(storage, modes);
  const size_t paired = supine_tiles_paired(storage, modes);
  UNROLL for (size_t pair = 1; pair < paired / 2; ++pair) {
    even =
        _mm512_fmadd_ps(weight(w, 2 * pair, common), coefficient(at, pair, false, storage), even);
    odd =
        _mm512_fmadd_ps(weight(w, 2 * pair + 1, common), coefficient(at, pair, true, storage), odd);
  }
  if (paired % 2 != 0) {
    even = _mm512_fmadd_ps(weight(w, paired - 1, common),
                           coefficient(at, paired / 2, false, storage), even);
  }
  UNROLL for (size_t t = 0; t < thirds; ++t) {
    const size_t k = paired + 3 * t;
    const unsigned char *words = at + supine_tiles_words_begin(paired, k);
    odd = _mm512_fmadd_ps(weight(w, k, common), third_coefficient(words, 0), odd);
    even = _mm512_fmadd_ps(weight(w, k + 1, common), third_coefficient(words, 1), even);
    odd = _mm512_fmadd_ps(weight(w, k + 2, common), third_coefficient(words, 2), odd);
  }
  return _mm512_add_ps(even, odd);
}

/* Numbers 0 to 15, 16 to 31, 32 to 47. */
typedef struct triples {
  __m512 v[3];
} triples;

/* The numbers of a direction or rest position; compact ones in the unit they are packed in. */
INLINE triples numbers(const unsigned char *at, bool compact) {
  if (!compact) {
    return (triples){{_mm512_load_ps(at), _mm512_load_ps(at + 64), _mm512_load_ps(at + 128)}};
  }
  enum { A_OR_B_AND_C = 0xF8 };
  const __m512i first = _mm512_load_si512(at);
  const __m512i second = _mm512_load_si512(at + 64);
  const __m512i third =
      _mm512_ternarylogic_epi32(_mm512_slli_epi32(first, 21), _mm512_slli_epi32(second, 10),
                                _mm512_set1_epi32(0x1FFC00), A_OR_B_AND_C);
  return (triples){
      {_mm512_cvtepi32_ps(first), _mm512_cvtepi32_ps(second), _mm512_cvtepi32_ps(third)}};
}

INLINE triples rest_positions(const supine_tiles *tiles, const unsigned char *tile, bool compact) {
  const __m512i unit = _mm512_set1_epi32((int)tiles->rest_unit);
  triples p = numbers(tile + tiles->rest_begin, compact);
  for (size_t j = 0; j < 3 && compact; ++j) {
    p.v[j] = _mm512_castsi512_ps(_mm512_add_epi32(_mm512_castps_si512(p.v[j]), unit));
  }
  return p;
}

/* The amount of each vertex at its three numbers. */
INLINE triples spread_amount(__m512 a) {
  const __m512i lane0 = _mm512_setr_epi32(0, 0, 0, 1, 1, 1, 2, 2, 2, 3, 3, 3, 4, 4, 4, 5);
  const __m512i lane1 = _mm512_setr_epi32(5, 5, 6, 6, 6, 7, 7, 7, 8, 8, 8, 9, 9, 9, 10, 10);
  const __m512i lane2 =
      _mm512_setr_epi32(10, 11, 11, 11, 12, 12, 12, 13, 13, 13, 14, 14, 14, 15, 15, 15);
  return (triples){{_mm512_permutexvar_ps(lane0, a), _mm512_permutexvar_ps(lane1, a),
                    _mm512_permutexvar_ps(lane2, a)}};
}

/* Three registers of x, y and z into x y z x y z ...; lane + 16 takes from the second of a pair. */
INLINE triples interleave(__m512 x, __m512 y, __m512 z) {
  const __m512i xy0 = _mm512_setr_epi32(0, 16, 0, 1, 17, 0, 2, 18, 0, 3, 19, 0, 4, 20, 0, 5);
  const __m512i xy1 = _mm512_setr_epi32(21, 0, 6, 22, 0, 7, 23, 0, 8, 24, 0, 9, 25, 0, 10, 26);
  const __m512i xy2 = _mm512_setr_epi32(0, 11, 27, 0, 12, 28, 0, 13, 29, 0, 14, 30, 0, 15, 31, 0);
  const __m512i z0 = _mm512_setr_epi32(0, 1, 16, 3, 4, 17, 6, 7, 18, 9, 10, 19, 12, 13, 20, 15);
  const __m512i z1 = _mm512_setr_epi32(0, 21, 2, 3, 22, 5, 6, 23, 8, 9, 24, 11, 12, 25, 14, 15);
  const __m512i z2 = _mm512_setr_epi32(26, 1, 2, 27, 4, 5, 28, 7, 8, 29, 10, 11, 30, 13, 14, 31);
  return (triples){{_mm512_permutex2var_ps(_mm512_permutex2var_ps(x, xy0, y), z0, z),
                    _mm512_permutex2var_ps(_mm512_permutex2var_ps(x, xy1, y), z1, z),
                    _mm512_permutex2var_ps(_mm512_permutex2var_ps(x, xy2, y), z2, z)}};
}

/* The reverse. */
INLINE triples separate(triples t) {
  const __m512i x01 = _mm512_setr_epi32(0, 3, 6, 9, 12, 15, 18, 21, 24, 27, 30, 0, 0, 0, 0, 0);
  const __m512i y01 = _mm512_setr_epi32(1, 4, 7, 10, 13, 16, 19, 22, 25, 28, 31, 0, 0, 0, 0, 0);
  const __m512i z01 = _mm512_setr_epi32(2, 5, 8, 11, 14, 17, 20, 23, 26, 29, 0, 0, 0, 0, 0, 0);
  const __m512i x2 = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 17, 20, 23, 26, 29);
  const __m512i y2 = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 18, 21, 24, 27, 30);
  const __m512i z2 = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 16, 19, 22, 25, 28, 31);
  return (triples){
      {_mm512_permutex2var_ps(_mm512_permutex2var_ps(t.v[0], x01, t.v[1]), x2, t.v[2]),
       _mm512_permutex2var_ps(_mm512_permutex2var_ps(t.v[0], y01, t.v[1]), y2, t.v[2]),
       _mm512_permutex2var_ps(_mm512_permutex2var_ps(t.v[0], z01, t.v[1]), z2, t.v[2])}};
}

/* An array that is written in order, past the cache where `stream`. A store past the cache must
 * fill an aligned line; where the array is not aligned, each line joins the end of one register to
 * the beginning of the next. */
typedef struct writer {
  __m512 last;  /* the register before this one */
  __m512i join; /* permutation of (last, next) that makes the line */
  float *to;
  size_t offset; /* numbers by which `to` is past an aligned line */
  bool stream;
  bool shared; /* the next store's line begins with numbers that are not ours */
} writer;

INLINE writer writer_open(float *to, const supine_target *target) {
  const size_t offset = (uintptr_t)to / sizeof *to % 16;
  const __m512i count = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
  const bool resume = target->held != NULL && target->continues;
  return (writer){resume ? _mm512_loadu_ps(target->held) : _mm512_setzero_ps(),
                  _mm512_add_epi32(count, _mm512_set1_epi32(16 - (int)offset)),
                  to,
                  offset,
                  target->stream,
                  !resume && offset != 0};
}

INLINE void writer_put(writer *w, __m512 next) {
  if (!w->stream) {
    _mm512_storeu_ps(w->to, next);
  } else if (w->shared) { /* the line begins with numbers that are not ours */
    _mm512_mask_storeu_ps(w->to, (__mmask16)(0xFFFFU >> w->offset), next);
    w->shared = false;
  } else {
    _mm512_stream_ps(w->to - w->offset, _mm512_permutex2var_ps(w->last, w->join, next));
  }
  w->last = next;
  w->to += 16;
}

/* The end of the last register, which no full line has taken. */
INLINE void writer_close(const writer *w, const supine_target *target) {
  if (target->held != NULL && target->continued) {
    _mm512_storeu_ps(target->held, w->last);
  } else if (w->stream && w->offset != 0) {
    _mm512_mask_storeu_ps(w->to - 16, (__mmask16)(0xFFFFU << (16 - w->offset)), w->last);
  }
}

/* x y z over their length: the estimate of the inverse root has 14 bits, Newton's step doubles
 * them. The smallest normal number keeps 0 from becoming NaN. */
INLINE void normalise(__m512 *x, __m512 *y, __m512 *z) {
  const __m512 square =
      _mm512_max_ps(_mm512_fmadd_ps(*x, *x, _mm512_fmadd_ps(*y, *y, _mm512_mul_ps(*z, *z))),
                    _mm512_set1_ps(0x1p-126F));
  const __m512 guess = _mm512_rsqrt14_ps(square);
  const __m512 error = _mm512_fnmadd_ps(_mm512_mul_ps(square, guess), guess, _mm512_set1_ps(1));
  const __m512 inverse = _mm512_fmadd_ps(_mm512_mul_ps(guess, error), _mm512_set1_ps(0.5F), guess);
  *x = _mm512_mul_ps(*x, inverse);
  *y = _mm512_mul_ps(*y, inverse);
  *z = _mm512_mul_ps(*z, inverse);
}

/* The gains x y z x y z ... of 16 numbers at a time. */
INLINE triples spread_gains(const float *g) {
  const __m512i lane = _mm512_setr_epi32(0, 1, 2, 0, 1, 2, 0, 1, 2, 0, 1, 2, 0, 1, 2, 0);
  const __m512 x = _mm512_setr_ps(g[0], g[1], g[2], 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0);
  const __m512 y = _mm512_setr_ps(g[1], g[2], g[0], 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0);
  const __m512 z = _mm512_setr_ps(g[2], g[0], g[1], 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0);
  return (triples){{_mm512_permutexvar_ps(lane, x), _mm512_permutexvar_ps(lane, y),
                    _mm512_permutexvar_ps(lane, z)}};
}

/* Eight parameters: constants of the instance and what stays in registers. */
INLINE triples deform_tile(const supine_tiles *tiles, const unsigned char *tile, const weights16 *w,
                           const triples *gain, bool with_rest, size_t known,
                           supine_storage storage, bool vector) {
  const size_t modes = known > 0 ? known : tiles->modes;
  const bool common = known > 0;
  const bool compact = supine_tiles_compact(storage);
  triples result;
  if (vector) {
    result = interleave(dot(tile, w, modes, common, storage),
                        dot(tile + tiles->axis_bytes, w, modes, common, storage),
                        dot(tile + 2 * tiles->axis_bytes, w, modes, common, storage));
    if (with_rest) {
      const triples rest = rest_positions(tiles, tile, compact);
      for (size_t j = 0; j < 3; ++j) {
        result.v[j] = _mm512_fmadd_ps(result.v[j], gain->v[j], rest.v[j]);
      }
      return result;
    }
    for (size_t j = 0; j < 3; ++j) {
      result.v[j] = _mm512_mul_ps(result.v[j], gain->v[j]);
    }
    return result;
  }
  const triples amount = spread_amount(dot(tile, w, modes, common, storage));
  triples direction = numbers(tile + tiles->direction_begin, compact);
  for (size_t j = 0; j < 3; ++j) {
    direction.v[j] = _mm512_mul_ps(direction.v[j], gain->v[j]);
  }
  if (with_rest) {
    const triples rest = rest_positions(tiles, tile, compact);
    for (size_t j = 0; j < 3; ++j) {
      result.v[j] = _mm512_fmadd_ps(amount.v[j], direction.v[j], rest.v[j]);
    }
  } else {
    for (size_t j = 0; j < 3; ++j) {
      result.v[j] = _mm512_mul_ps(amount.v[j], direction.v[j]);
    }
  }
  return result;
}

/* What a caller's constants make of one loop. */
typedef struct form {
  supine_storage storage;
  bool vector, rest, joined;
  size_t modes; /* where the compiler knows how many; else 0 */
} form;

INLINE void deform_all(const supine_tiles *any, const float *weights, size_t first, size_t count,
                       const supine_target *target, form f) {
  supine_tiles same = *any;
  if (f.modes > 0) {
    supine_tiles_layout(&same, f.storage, f.modes, f.vector, any->count);
  }
  const supine_tiles *tiles = &same;
  const unsigned char *tile = tiles->bytes + first * tiles->stride;
  writer out[3] = {writer_open(target->x, target), writer_open(target->y, target),
                   writer_open(target->z, target)}; /* joined: the first alone */
  const triples gain = spread_gains(weights + tiles->modes);
  weights16 w = {.at = weights};
  if (f.modes > 0) {
    UNROLL for (size_t k = 0; k < f.modes; ++k) {
      w.v[k] = _mm512_set1_ps(weights[k]);
    }
  }
  for (size_t t = 0; t < count; ++t, tile += tiles->stride) {
    supine_prefetch_tile(tile, tiles->stride, target->prefetch);
    triples xyz = deform_tile(tiles, tile, &w, &gain, f.rest, f.modes, f.storage, f.vector);
    if (f.joined) {
      writer_put(&out[0], xyz.v[0]);
      writer_put(&out[0], xyz.v[1]);
      writer_put(&out[0], xyz.v[2]);
    } else {
      xyz = separate(xyz);
      for (size_t axis = 0; axis < 3; ++axis) {
        writer_put(&out[axis], xyz.v[axis]);
      }
    }
  }
  for (size_t axis = 0; axis < (f.joined ? 1 : 3) && count > 0; ++axis) {
    writer_close(&out[axis], target);
  }
}

/* One instance for the common number of modes and form of target, one for the others. */
INLINE void deform_kind(const supine_tiles *tiles, const float *weights, size_t first, size_t count,
                        const supine_target *target, supine_storage storage, bool vector) {
  const bool joined = target->y == NULL;
  if (target->rest && joined && tiles->modes == COMMON_MODES) {
    deform_all(tiles, weights, first, count, target,
               (form){storage, vector, .rest = true, .joined = true, .modes = COMMON_MODES});
  } else {
    deform_all(tiles, weights, first, count, target,
               (form){storage, vector, .rest = target->rest, .joined = joined});
  }
}

/* Modes that words begin, that they hold second and third: compact.h. */
INLINE __m512 normal_mode(__m512i words, size_t which) {
  return _mm512_cvtepi32_ps(which == 0   ? words /* shifts take constants */
                            : which == 1 ? _mm512_slli_epi32(words, 13)
                                         : _mm512_slli_epi32(words, 23));
}

/* A normal along one axis, before its length is taken out: a chain for each place in the words. */
INLINE __m512 dot_normal(const unsigned char *at, const float *w, size_t words) {
  __m512 sum[3] = {_mm512_setzero_ps(), _mm512_setzero_ps(), _mm512_setzero_ps()};
  UNROLL for (size_t j = 0; j < words; ++j) {
    const __m512i word = _mm512_load_si512(at + 64 * j);
    UNROLL for (size_t which = 0; which < 3; ++which) {
      sum[which] = _mm512_fmadd_ps(_mm512_set1_ps(w[which * words + j]), normal_mode(word, which),
                                   sum[which]);
    }
  }
  return _mm512_add_ps(_mm512_add_ps(sum[0], sum[1]), sum[2]);
}

INLINE void light_words(const supine_tiles *tiles, const float *weights, size_t first, size_t count,
                        const supine_target *target, size_t words) {
  const size_t axis_bytes = 64 * words;
  const unsigned char *tile = tiles->bytes + first * 3 * axis_bytes;
  writer out = writer_open(target->x, target);
  for (size_t t = 0; t < count; ++t, tile += 3 * axis_bytes) {
    supine_prefetch_tile(tile, 3 * axis_bytes, target->prefetch);
    __m512 x = dot_normal(tile, weights, words);
    __m512 y = dot_normal(tile + axis_bytes, weights, words);
    __m512 z = dot_normal(tile + 2 * axis_bytes, weights, words);
    normalise(&x, &y, &z);
    const triples xyz = interleave(x, y, z);
    for (size_t j = 0; j < 3; ++j) {
      writer_put(&out, xyz.v[j]);
    }
  }
  if (count > 0) {
    writer_close(&out, target);
  }
}

INLINE void widen_coefficients(const unsigned char *at, size_t modes, supine_storage storage,
                               float *c) {
  const size_t paired = supine_tiles_paired(storage, modes);
  for (size_t k = 0; k < paired; ++k) {
    _mm512_store_ps(c + 16 * k, coefficient(at, k / 2, k % 2 != 0, storage));
  }
  for (size_t k = paired; k < modes; ++k) {
    const unsigned char *words = at + supine_tiles_words_begin(paired, k);
    _mm512_store_ps(c + 16 * k, third_coefficient(words, (k - paired) % 3));
  }
}

INLINE void store(triples t, float *to) {
  for (size_t j = 0; j < 3; ++j) {
    _mm512_store_ps(to + 16 * j, t.v[j]);
  }
}

#include "runtime/kernels/instances.h"

const supine_kernels supine_kernels_avx512 = {deform, light, widen};
#else
const supine_kernels supine_kernels_avx512 = {NULL, NULL, NULL};
#endif
