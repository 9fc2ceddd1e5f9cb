/* SPDX-License-Identifier: MIT */
/* Kernels for vectors of four numbers, which GCC and Clang compile for every processor: SSE2, NEON,
 * 128-bit vectors of WebAssembly. */
#include <math.h>

#define KERNELS supine_kernels_portable
#define LANES 4
#define FMA(a, b, c) ((a) * (b) + (c))
#define FMA4(a, b, c) ((a) * (b) + (c))
#define RSQRT(x) (1 / (vf){sqrtf((x)[0]), sqrtf((x)[1]), sqrtf((x)[2]), sqrtf((x)[3])})
#define STREAM(to, v) memcpy(to, &(v), sizeof(v))
#include "runtime/kernels/kernel.h"
