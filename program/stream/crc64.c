/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute CRC-64 with tables, 16 bytes at a time. */
#include <pthread.h>
#include <string.h>

#include "program/stream/message.h"

static const uint64_t polynomial = 0x42F0E1EBA9EA3693u; /* CRC polynomial without its term x^64 */

/* table[k][b] is the CRC of the byte b followed by k zero bytes; computed once. */
static uint64_t table[16][256];
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
    for (size_t k = 0; k < 16; ++k) {
      table[k][b] = multiply(b, power_of(8 + k));
    }
  }
}

uint64_t supine_stream_crc64(uint64_t crc, const void *bytes, size_t size) {
  (void)pthread_once(&once, make_tables);
  const unsigned char *at = bytes;
  for (; size >= 16; at += 16, size -= 16) {
    uint64_t word[2];
    memcpy(word, at, sizeof word);
    word[0] = __builtin_bswap64(word[0]) ^ crc; /* hosts are little-endian */
    word[1] = __builtin_bswap64(word[1]);
    crc = 0;
    for (int k = 0; k < 8; ++k) {
      crc ^= table[8 + k][word[0] >> 8 * k & 255] ^ table[k][word[1] >> 8 * k & 255];
    }
  }
  for (; size != 0; ++at, --size) {
    crc = (crc << 8) ^ table[0][(crc >> 56) ^ *at];
  }
  return crc;
}
