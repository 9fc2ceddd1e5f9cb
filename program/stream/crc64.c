/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute CRC-64: 64 bytes per step if the processor has carry-less multiplication, else byte by
 * byte. */
#include <pthread.h>

#if defined(__x86_64__)
#include <immintrin.h>
#define CRC64_CARRY_LESS 1
#endif

#include "program/stream/message.h"

static const uint64_t polynomial = 0x42F0E1EBA9EA3693u; /* without the term x^64 */

/* Tables computed once: table[b] = b(x) x^64 mod P, and powers of x for folding. */
static struct {
  uint64_t table[256];
  uint64_t far[2], near[2]; /* x^(512 + 64), x^512; x^(128 + 64), x^128 */
} known;
static pthread_once_t once = PTHREAD_ONCE_INIT;

static uint64_t times_x(uint64_t a) {
  return (a << 1) ^ ((a >> 63) != 0 ? polynomial : 0);
}

static uint64_t multiply(uint64_t a, uint64_t b) {
  uint64_t product = 0;
  for (int bit = 63; bit >= 0; --bit) {
    product = times_x(product) ^ ((b >> bit & 1) != 0 ? a : 0);
  }
  return product;
}

uint64_t supine_stream_crc64_power(size_t size) {
  uint64_t power = 1;
  uint64_t square = 1u << 8; /* x^8, then its square, ... */
  for (; size != 0; size >>= 1) {
    power = (size & 1) != 0 ? multiply(power, square) : power;
    square = multiply(square, square);
  }
  return power;
}

uint64_t supine_stream_crc64_join(uint64_t first, uint64_t second, uint64_t power) {
  return multiply(first, power) ^ second;
}

static void make_tables(void) {
  for (unsigned b = 0; b < 256; ++b) {
    uint64_t value = (uint64_t)b << 56;
    for (int bit = 0; bit < 8; ++bit) {
      value = times_x(value);
    }
    known.table[b] = value;
  }
  known.far[0] = supine_stream_crc64_power(72);
  known.far[1] = supine_stream_crc64_power(64);
  known.near[0] = supine_stream_crc64_power(24);
  known.near[1] = supine_stream_crc64_power(16);
}

static uint64_t by_bytes(uint64_t crc, const unsigned char *at, size_t size) {
  for (; size != 0; ++at, --size) {
    crc = (crc << 8) ^ known.table[(crc >> 56) ^ *at];
  }
  return crc;
}

#ifdef CRC64_CARRY_LESS
typedef __m128i lane; /* 16 bytes of the message; the first byte is the most significant */

#define CARRY_LESS __attribute__((target("pclmul,ssse3")))

CARRY_LESS static lane take(const unsigned char *at) {
  const lane front = _mm_set_epi8(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
  return _mm_shuffle_epi8(_mm_loadu_si128((const lane *)(const void *)at), front);
}

/* Compute a_high x^(n + 64) + a_low x^n + next, with powers = (x^(n + 64), x^n). */
CARRY_LESS static lane fold(lane a, lane powers, lane next) {
  return _mm_xor_si128(next, _mm_xor_si128(_mm_clmulepi64_si128(a, powers, 0x11),
                                           _mm_clmulepi64_si128(a, powers, 0x00)));
}

/* Compute the CRC of at least 64 bytes, a multiple of 16. */
CARRY_LESS static uint64_t by_folding(uint64_t crc, const unsigned char *at, size_t size) {
  const lane far = _mm_set_epi64x((long long)known.far[0], (long long)known.far[1]);
  const lane near = _mm_set_epi64x((long long)known.near[0], (long long)known.near[1]);
  lane part[4] = {take(at), take(at + 16), take(at + 32), take(at + 48)};
  part[0] = _mm_xor_si128(part[0], _mm_set_epi64x((long long)crc, 0));
  for (at += 64, size -= 64; size >= 64; at += 64, size -= 64) {
    for (int i = 0; i < 4; ++i) {
      part[i] = fold(part[i], far, take(at + 16 * i));
    }
  }
  lane sum = part[0];
  for (int i = 1; i < 4; ++i) {
    sum = fold(sum, near, part[i]);
  }
  for (; size != 0; at += 16, size -= 16) {
    sum = fold(sum, near, take(at));
  }
  unsigned char remainder[16]; /* congruent to the whole message mod P */
  const lane front = _mm_set_epi8(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
  _mm_storeu_si128((lane *)(void *)remainder, _mm_shuffle_epi8(sum, front));
  return by_bytes(0, remainder, sizeof remainder);
}
#endif

uint64_t supine_stream_crc64(uint64_t crc, const void *bytes, size_t size) {
  (void)pthread_once(&once, make_tables);
  const unsigned char *at = bytes;
#ifdef CRC64_CARRY_LESS
  if (size >= 64 && __builtin_cpu_supports("pclmul") && __builtin_cpu_supports("ssse3")) {
    const size_t most = size & ~(size_t)15;
    crc = by_folding(crc, at, most);
    at += most;
    size -= most;
  }
#endif
  return by_bytes(crc, at, size);
}
