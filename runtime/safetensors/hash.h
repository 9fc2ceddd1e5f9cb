/* SPDX-License-Identifier: MIT */
/** @file
 * The 64-bit hash behind the checksum of basis files of version 1, which are read for ever. */
#ifndef SUPINE_HASH_H
#define SUPINE_HASH_H

#include <stddef.h>
#include <stdint.h>

/** Hash of `size` bytes.
 *
 * Eight lanes take the little-endian 64-bit words in turn, the last block padded with zeros:
 *
 *     lane = rotate_left(lane ^ word, 29) * 0x9E3779B97F4A7C15        lane j begins at seed + j
 *
 * then the size and the eight lanes, in order, pass through the same step into one word that
 * begins at the seed. Each step is a bijection of the lane and of the word, so that a change
 * within any one word always shows. */
uint64_t supine_safetensors_hash(const void *bytes, size_t size, uint64_t seed);

#endif
