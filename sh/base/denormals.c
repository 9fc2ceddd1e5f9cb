/* SPDX-License-Identifier: MIT */
/* Treat denormal numbers as zero: the response to a unit force decays into them, and they are
 * slow. */
#include "sh/base/denormals.h"

#if defined(__SSE2__)
#include <xmmintrin.h>

unsigned supine_denormals_flush(void) {
  const unsigned saved = _mm_getcsr();
  _mm_setcsr(saved | 0x8040U); /* flush to zero, denormals are zero */
  return saved;
}

void supine_denormals_restore(unsigned saved) {
  _mm_setcsr(saved);
}
#else
unsigned supine_denormals_flush(void) {
  return 0;
}

void supine_denormals_restore(unsigned saved) {
  (void)saved;
}
#endif
