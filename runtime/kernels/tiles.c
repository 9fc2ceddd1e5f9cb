/* SPDX-License-Identifier: MIT */
/* Choose the kernels for this processor. */
#include "runtime/kernels/tiles.h"

#if defined(__x86_64__)
#include <cpuid.h>
#include <stdlib.h>
#include <string.h>

static bool has_avx2(void) {
  return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
}
static bool has_avx512(void) {
  return has_avx2() && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw");
}

/* Return whether a processor of AMD's family 25 is Zen 3, by its model. The others are Zen 4. */
static bool is_zen3(unsigned model) {
  return model < 0x10 || (model >= 0x20 && model < 0x60);
}

/* Choose how to prefetch, by the family and the model of the processor. AMD Zen 4 (family 25)
 * fetches cache lines in pairs. To prefetch every other line (NEAR) is therefore best: 16 million
 * vertices with 16 int16 modes are read at 39 GB/s, against 37 GB/s without prefetching and 36 GB/s
 * with every line (FAR). On AMD Zen 3 (also family 25) and Zen 5 (family 26), FAR is the fastest: a
 * million vertices with 16 vectors of int16 take 9.2 ns each on Zen 3, 12.3 to 20.5 ns with NEAR. */
supine_prefetch supine_kernels_prefetch_choose(void) {
  unsigned a = 0;
  unsigned b = 0;
  unsigned c = 0;
  unsigned d = 0;
  const bool amd = __get_cpuid(0, &a, &b, &c, &d) != 0 && b == signature_AMD_ebx &&
                   d == signature_AMD_edx && c == signature_AMD_ecx;
  const bool known = __get_cpuid(1, &a, &b, &c, &d) != 0;
  const unsigned family = (a >> 8 & 15U) + (a >> 20 & 255U); /* base plus extended CPU family */
  const unsigned model = (a >> 4 & 15U) | (a >> 12 & 0xF0U); /* base and extended model */
  const bool far = family == 26 || (family == 25 && is_zen3(model));
  return amd && known && far ? SUPINE_PREFETCH_FAR : SUPINE_PREFETCH_NEAR;
}

/* Return the instruction set that the environment variable SUPINE_SIMD names: AUTO if it is not
 * set, COUNT if it names none. */
static supine_simd requested(void) {
  static const char *const names[SUPINE_SIMD_COUNT] = {"auto", "portable", "avx2", "avx512"};
  const char *name = getenv("SUPINE_SIMD"); /* NOLINT(concurrency-mt-unsafe) */
  supine_simd simd = SUPINE_SIMD_AUTO;
  if (name != NULL) {
    while (simd < SUPINE_SIMD_COUNT && strcmp(name, names[simd]) != 0) {
      ++simd;
    }
  }
  return simd;
}
#else
static bool has_avx2(void) {
  return false;
}
static bool has_avx512(void) {
  return false;
}
static supine_simd requested(void) {
  return SUPINE_SIMD_AUTO;
}
supine_prefetch supine_kernels_prefetch_choose(void) {
  return SUPINE_PREFETCH_NONE;
}
#endif

const supine_kernels *supine_kernels_choose(supine_simd *simd) {
  const bool avx2 = supine_kernels_avx2.deform != NULL && has_avx2();
  const bool avx512 = supine_kernels_avx512.deform != NULL && has_avx512();
  if (*simd == SUPINE_SIMD_AUTO) {
    *simd = requested();
  }
  if (*simd == SUPINE_SIMD_AUTO) {
    if (avx512) {
      *simd = SUPINE_SIMD_AVX512;
    } else {
      *simd = avx2 ? SUPINE_SIMD_AVX2 : SUPINE_SIMD_PORTABLE;
    }
  }
  switch (*simd) {
  case SUPINE_SIMD_PORTABLE:
    return &supine_kernels_portable;
  case SUPINE_SIMD_AVX2:
    return avx2 ? &supine_kernels_avx2 : NULL;
  case SUPINE_SIMD_AVX512:
    return avx512 ? &supine_kernels_avx512 : NULL;
  case SUPINE_SIMD_AUTO:
  case SUPINE_SIMD_COUNT:
    break;
  }
  return NULL;
}
