/* SPDX-License-Identifier: MIT */
/* Kernels for AVX-512 F and BW: one vector holds one number for each vertex of a tile. */
#include "runtime/kernels/tiles.h"

#if defined(__AVX512F__) && defined(__AVX512BW__)
#include <immintrin.h>

/* An output array, written in order. If `stream` is true, stores bypass the caches and must fill
 * whole cache lines. In an unaligned array, each line is then joined from the end of one vector and
 * the beginning of the next. */
typedef struct writer {
  __m512 last;  /* vector of the last writer_put() */
  __m512i join; /* permutation that selects a cache line from `last` and the next vector */
  float *to;
  size_t offset; /* number of floats from the start of a cache line to `to` */
  bool stream;
  bool partial; /* the next store is the first one, and fills only a part of a cache line */
} writer;

static inline __attribute__((always_inline)) writer writer_open(const supine_target *target) {
  float *to = target->xyz;
  const size_t offset = (uintptr_t)to / sizeof *to % 16;
  const __m512i count = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
  return (writer){_mm512_setzero_ps(),
                  _mm512_add_epi32(count, _mm512_set1_epi32(16 - (int)offset)),
                  to,
                  offset,
                  target->stream,
                  offset != 0};
}

static inline __attribute__((always_inline)) void writer_put(writer *w, __m512 next) {
  if (!w->stream) {
    _mm512_storeu_ps(w->to, next);
  } else if (w->partial) {
    _mm512_mask_storeu_ps(w->to, (__mmask16)(0xFFFFU >> w->offset), next);
    w->partial = false;
  } else {
    _mm512_stream_ps(w->to - w->offset, _mm512_permutex2var_ps(w->last, w->join, next));
  }
  w->last = next;
  w->to += 16;
}

/* Store the end of the last vector, which fills only part of a cache line. */
static inline __attribute__((always_inline)) void writer_close(const writer *w) {
  if (w->stream && w->offset != 0) {
    _mm512_mask_storeu_ps(w->to - 16, (__mmask16)(0xFFFFU << (16 - w->offset)), w->last);
  }
}

#define KERNELS supine_kernels_avx512
#define LANES 16
#define FMA(a, b, c) ((vf)_mm512_fmadd_ps(a, b, c))
#define FMA4(a, b, c) ((quad)_mm_fmadd_ps(a, b, c))
#define RSQRT(x) ((vf)_mm512_rsqrt14_ps(x))
#define OWN_WRITER
#include "runtime/kernels/kernel.h"
#else
const supine_kernels supine_kernels_avx512 = {NULL, NULL, NULL};
#endif
