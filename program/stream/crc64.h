/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * The checksum of OpenIGTLink messages: CRC-64 of ECMA-182, most significant bit first, from 0,
 *
 *     crc(M) = M(x) x^64 mod P,     P = x^64 + 0x42F0E1EBA9EA3693
 *
 * It is linear, so that the checksums of two parts give that of the whole. */
#ifndef SUPINE_STREAM_CRC64_H
#define SUPINE_STREAM_CRC64_H

#include <stddef.h>
#include <stdint.h>

/** Continue from `crc` (0 at first) over more bytes. Thread-safe. */
uint64_t supine_stream_crc64(uint64_t crc, const void *bytes, size_t size);

/** Compute x^(8 size) mod P, by which `size` further bytes multiply a checksum. */
uint64_t supine_stream_crc64_power(size_t size);

/** Join checksums: crc(A B) = crc(A) x^(8 |B|) + crc(B).
 * @param power  supine_stream_crc64_power of the second part's size */
uint64_t supine_stream_crc64_join(uint64_t first, uint64_t second, uint64_t power);

#endif
