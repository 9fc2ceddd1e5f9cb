/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute CRC-64 by carry-less multiplication, 256 or 64 bytes at a time, or else byte by byte. */
#include <pthread.h>
#include <stdbool.h>

#if defined(__x86_64__)
#include <immintrin.h>
#define CRC64_CARRY_LESS 1
#endif

#include "program/stream/message.h"

static const uint64_t polynomial = 0x42F0E1EBA9EA3693u; /* CRC polynomial without its term x^64 */

/* Indices of `distance`. fold() carries 16 bytes of a message forward by such a distance, bytes. */
enum { NEAR, FAR, FARTHEST, DISTANCES };
static const size_t distance[DISTANCES] = {16, 64, 256};

/* Polynomials modulo the CRC polynomial, computed once:
 *     table  [256] CRC of each byte: x^64 times the polynomial with the byte's bits as coefficients
 *     power  {x^n, x^(n + 64)} for each distance, where n is the distance in bits; for fold() */
static struct { uint64_t table[256], power[DISTANCES][2]; } known;
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

/* Compute x^(8 size) modulo the CRC polynomial: the factor by which `size` appended zero bytes
 * multiply a checksum. */
static uint64_t power_of(size_t size) {
  uint64_t power = 1;
  uint64_t square = 1u << 8; /* in turn x^8, x^16, x^32, ... */
  for (; size != 0; size >>= 1) {
    power = (size & 1) != 0 ? multiply(power, square) : power;
    square = multiply(square, square);
  }
  return power;
}

uint64_t supine_stream_crc64_join(uint64_t first, uint64_t second, size_t size) {
  return multiply(first, power_of(size)) ^ second;
}

static void make_tables(void) {
  for (unsigned b = 0; b < 256; ++b) {
    uint64_t value = (uint64_t)b << 56;
    for (int bit = 0; bit < 8; ++bit) {
      value = times_x(value);
    }
    known.table[b] = value;
  }
  for (int i = 0; i < DISTANCES; ++i) {
    known.power[i][0] = power_of(distance[i]);
    known.power[i][1] = power_of(distance[i] + 8);
  }
}

static uint64_t by_bytes(uint64_t crc, const unsigned char *at, size_t size) {
  for (; size != 0; ++at, --size) {
    crc = (crc << 8) ^ known.table[(crc >> 56) ^ *at];
  }
  return crc;
}

#ifdef CRC64_CARRY_LESS
typedef __m128i lane; /* 16 bytes of the message; the first byte is the most significant */
typedef __m512i lanes;

#define CARRY_LESS __attribute__((target("pclmul,ssse3")))
#define WIDE __attribute__((target("vpclmulqdq,avx512bw")))
#define REVERSED _mm_set_epi8(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15)

/* Load 16 bytes in reverse order. */
CARRY_LESS static lane take(const void *at) {
  return _mm_shuffle_epi8(_mm_loadu_si128(at), REVERSED);
}

WIDE static lanes take_wide(const void *at) {
  return _mm512_shuffle_epi8(_mm512_loadu_si512(at), _mm512_broadcast_i32x4(REVERSED));
}

/* Return 128 bits that equal `a` times x^n plus `next` modulo the CRC polynomial. `next` is the
 * part of the message n bits after `a`. `powers` has the factors of the low and the high half of
 * `a`: x^n and x^(n + 64). */
CARRY_LESS static lane fold(lane a, lane powers, lane next) {
  return _mm_xor_si128(next, _mm_xor_si128(_mm_clmulepi64_si128(a, powers, 0x11),
                                           _mm_clmulepi64_si128(a, powers, 0x00)));
}

/* Extend a CRC by `size` bytes. `size` must be a multiple of 16 and at least 64. */
CARRY_LESS static uint64_t by_folding(uint64_t crc, const unsigned char *at, size_t size) {
  const lane far = _mm_loadu_si128((const void *)known.power[FAR]);
  const lane near = _mm_loadu_si128((const void *)known.power[NEAR]);
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
  const lane remainder = take(&sum);
  return by_bytes(0, (const void *)&remainder, sizeof remainder);
}

/* Extend a CRC by `size` bytes. `size` must be a multiple of 256 and at least 256. */
WIDE static uint64_t by_wide_folding(uint64_t crc, const unsigned char *at, size_t size) {
  const lanes powers = _mm512_broadcast_i32x4(_mm_loadu_si128((const void *)known.power[FARTHEST]));
  lanes part[4];
  for (int i = 0; i < 4; ++i) {
    part[i] = take_wide(at + 64 * i);
  }
  part[0] = _mm512_xor_si512(part[0], _mm512_zextsi128_si512(_mm_set_epi64x((long long)crc, 0)));
  for (at += 256, size -= 256; size != 0; at += 256, size -= 256) {
    for (int i = 0; i < 4; ++i) {
      const lanes high = _mm512_clmulepi64_epi128(part[i], powers, 0x11);
      const lanes low = _mm512_clmulepi64_epi128(part[i], powers, 0x00);
      part[i] = _mm512_xor_si512(take_wide(at + 64 * i), _mm512_xor_si512(high, low));
    }
  }
  for (int i = 0; i < 4; ++i) {
    part[i] = take_wide(&part[i]);
  }
  return by_folding(0, (const void *)part, sizeof part);
}
#endif

uint64_t supine_stream_crc64(uint64_t crc, const void *bytes, size_t size) {
  (void)pthread_once(&once, make_tables);
  const unsigned char *at = bytes;
#ifdef CRC64_CARRY_LESS
  if (__builtin_cpu_supports("pclmul") && __builtin_cpu_supports("ssse3")) {
    const bool wide = __builtin_cpu_supports("vpclmulqdq") && __builtin_cpu_supports("avx512bw");
    const size_t most = wide ? size & ~(size_t)255 : 0;
    crc = most > 0 ? by_wide_folding(crc, at, most) : crc;
    at += most;
    size -= most;
    const size_t rest = size >= 64 ? size & ~(size_t)15 : 0;
    crc = rest > 0 ? by_folding(crc, at, rest) : crc;
    at += rest;
    size -= rest;
  }
#endif
  return by_bytes(crc, at, size);
}
