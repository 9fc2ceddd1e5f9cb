/* SPDX-License-Identifier: MIT */
/* The 64-bit hash of version 1. */
#include <string.h>

#include "runtime/safetensors/hash.h"

enum { LANES = 8, BLOCK = LANES * 8 };

static uint64_t hash_step(uint64_t lane, uint64_t word) {
  const uint64_t mixed = lane ^ word;
  return ((mixed << 29) | (mixed >> 35)) * UINT64_C(0x9E3779B97F4A7C15);
}

static void hash_block(uint64_t lanes[LANES], const unsigned char *bytes) {
  for (size_t j = 0; j < LANES; ++j) {
    uint64_t word = 0;
    memcpy(&word, bytes + 8 * j, sizeof word);
    lanes[j] = hash_step(lanes[j], word);
  }
}

uint64_t supine_safetensors_hash(const void *bytes, size_t size, uint64_t seed) {
  const unsigned char *at = bytes;
  uint64_t lanes[LANES];
  for (size_t j = 0; j < LANES; ++j) {
    lanes[j] = seed + j;
  }
  size_t left = size;
  for (; left >= BLOCK; left -= BLOCK, at += BLOCK) {
    hash_block(lanes, at);
  }
  if (left > 0) {
    unsigned char last[BLOCK] = {0};
    memcpy(last, at, left);
    hash_block(lanes, last);
  }
  uint64_t hash = hash_step(seed, size);
  for (size_t j = 0; j < LANES; ++j) {
    hash = hash_step(hash, lanes[j]);
  }
  return hash;
}
