/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute CRC-64 with tables, 16 bytes at a time. */
#include <pthread.h>
#include <string.h>

#include "program/stream/message.h"

static const uint64_t polynomial = 0x42F0E1EBA9EA3693u; /* CRC polynomial without its term x^64 */

/* table[k][b] is the CRC of the byte b followed by k zero bytes; computed once. */
static uint64_t table[16][256];
static pthread_once_t once = PTHREAD_ONCE_INIT;

static void make_tables(void) {
  for (uint64_t b = 0; b < 256; ++b) {
    uint64_t crc = b << 56;
    for (size_t bit = 1; bit <= 8 * 16; ++bit) {
      crc = (crc << 1) ^ ((crc >> 63) != 0 ? polynomial : 0);
      table[(bit - 1) / 8][b] = crc; /* the last of eight bits stays */
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
