/* SPDX-License-Identifier: MIT */
/* Kernels for AVX2 and FMA: two vectors hold one number for each of the 16 vertices of a tile. */
#include "runtime/kernels/tiles.h"

#if defined(__AVX2__) && defined(__FMA__)
#include <immintrin.h>

/* Store a vector. If the address is aligned to 16 bytes, as memory from malloc is, bypass the
 * caches: with one store if it is aligned to 32 bytes, otherwise with two. */
static inline __attribute__((always_inline)) void stream8(float *to, __m256 v) {
  if ((uintptr_t)to % 16 != 0) {
    _mm256_storeu_ps(to, v);
  } else if ((uintptr_t)to % 32 == 0) {
    _mm256_stream_ps(to, v);
  } else {
    _mm_stream_ps(to, _mm256_castps256_ps128(v));
    _mm_stream_ps(to + 4, _mm256_extractf128_ps(v, 1));
  }
}

#define KERNELS supine_kernels_avx2
#define LANES 8
#define FMA(a, b, c) ((vf)_mm256_fmadd_ps(a, b, c))
#define FMA4(a, b, c) ((quad)_mm_fmadd_ps(a, b, c))
#define RSQRT(x) ((vf)_mm256_rsqrt_ps(x))
#define STREAM(to, v) stream8(to, v)
#include "runtime/kernels/kernel.h"
#else
const supine_kernels supine_kernels_avx2 = {NULL, NULL, NULL};
#endif
