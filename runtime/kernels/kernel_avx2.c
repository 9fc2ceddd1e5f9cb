/* SPDX-License-Identifier: MIT */
/* Kernels for AVX2 and FMA: two vectors hold one number for each of the 16 vertices of a tile. */
#include "runtime/kernels/tiles.h"

#if defined(__AVX2__) && defined(__FMA__)
#include <immintrin.h>

/* How an array is written: by plain stores; by stores of 32 bytes that bypass the caches, which
 * need an address that is aligned to 32 bytes; or, where it is aligned to 16 bytes only, as memory
 * from malloc is, by such stores of the end of one vector and the beginning of the next. */
typedef enum writing { PLAIN, ALIGNED, JOINED } writing;

/* An output array, written in order. */
typedef struct writer {
  __m256 last; /* vector of the last writer_put() */
  float *to;
  writing how;
  bool first; /* the next store is the first of a JOINED array, and fills 16 bytes */
} writer;

static inline __attribute__((always_inline)) writer writer_open(const supine_target *target) {
  const uintptr_t offset = (uintptr_t)target->xyz % 32;
  writing how = PLAIN;
  if (target->stream && offset == 0) {
    how = ALIGNED;
  } else if (target->stream && offset == 16) {
    how = JOINED;
  }
  return (writer){_mm256_setzero_ps(), target->xyz, how, true};
}

static inline __attribute__((always_inline)) void writer_put(writer *w, __m256 next) {
  if (w->how == PLAIN) {
    _mm256_storeu_ps(w->to, next);
  } else if (w->how == ALIGNED) {
    _mm256_stream_ps(w->to, next);
  } else if (w->first) {
    _mm_stream_ps(w->to, _mm256_castps256_ps128(next));
    w->first = false;
  } else {
    _mm256_stream_ps(w->to - 4, _mm256_permute2f128_ps(w->last, next, 0x21));
  }
  w->last = next;
  w->to += 8;
}

/* Store the end of the last vector of a JOINED array. */
static inline __attribute__((always_inline)) void writer_close(const writer *w) {
  if (w->how == JOINED) {
    _mm_stream_ps(w->to - 4, _mm256_extractf128_ps(w->last, 1));
  }
}

/* Interleave the coordinates of eight vertices as x y z x y z ... in out[0] to out[2]: by three
 * shuffles within halves of 16 bytes, three more, and three of halves. */
static inline __attribute__((always_inline)) void interleave8(__m256 x, __m256 y, __m256 z,
                                                              __m256 out[3]) {
  const __m256 xy = _mm256_shuffle_ps(x, y, _MM_SHUFFLE(2, 0, 2, 0));  /* x0 x2 y0 y2 */
  const __m256 yz = _mm256_shuffle_ps(y, z, _MM_SHUFFLE(3, 1, 3, 1));  /* y1 y3 z1 z3 */
  const __m256 zx = _mm256_shuffle_ps(z, x, _MM_SHUFFLE(3, 1, 2, 0));  /* z0 z2 x1 x3 */
  const __m256 a = _mm256_shuffle_ps(xy, zx, _MM_SHUFFLE(2, 0, 2, 0)); /* x0 y0 z0 x1 */
  const __m256 b = _mm256_shuffle_ps(yz, xy, _MM_SHUFFLE(3, 1, 2, 0)); /* y1 z1 x2 y2 */
  const __m256 c = _mm256_shuffle_ps(zx, yz, _MM_SHUFFLE(3, 1, 3, 1)); /* z2 x3 y3 z3 */
  out[0] = _mm256_permute2f128_ps(a, b, 0x20);
  out[1] = _mm256_permute2f128_ps(c, a, 0x30);
  out[2] = _mm256_permute2f128_ps(b, c, 0x31);
}

#define KERNELS supine_kernels_avx2
#define LANES 8
#define FMA(a, b, c) ((vf)_mm256_fmadd_ps(a, b, c))
#define FMA4(a, b, c) ((quad)_mm_fmadd_ps(a, b, c))
#define RSQRT(x) ((vf)_mm256_rsqrt_ps(x))
#define OWN_WRITER
#define OWN_INTERLEAVE interleave8
#include "runtime/kernels/kernel.h"
#else
const supine_kernels supine_kernels_avx2 = {NULL, NULL, NULL};
#endif
