/* SPDX-License-Identifier: MIT */
/** @file
 * Numbers in fewer bits: halves, and floats of 24 bits. Plain C, one at a time. */
#ifndef SUPINE_COMPACT_H
#define SUPINE_COMPACT_H

#include <stdint.h>
#include <string.h>

static inline uint32_t float_bits(float value) {
  uint32_t bits = 0;
  memcpy(&bits, &value, sizeof bits);
  return bits;
}

static inline float bits_float(uint32_t bits) {
  float value = 0;
  memcpy(&value, &bits, sizeof value);
  return value;
}

/** A half's value; never infinite or NaN, as none is stored. */
static inline float half_widen(uint16_t half) {
  const uint32_t bits = ((uint32_t)(half & 0x8000U) << 16) | ((uint32_t)(half & 0x7FFFU) << 13);
  return bits_float(bits) * 0x1p112F; /* the exponents' offsets differ by 127 - 15 */
}

/** The nearest half, ties to even; |value| must be below 65504. */
static inline uint16_t half_narrow(float value) {
  const uint32_t sign = (float_bits(value) >> 16) & 0x8000U;
  const float size = bits_float(float_bits(value) & 0x7FFFFFFFU);
  if (size < 0x1p-14F) { /* a subnormal half: a multiple of 2^-24; adding rounds it */
    return (uint16_t)(sign | (float_bits(size + 0.5F) - float_bits(0.5F)));
  }
  const uint32_t bits = float_bits(size) - (112U << 23);
  return (uint16_t)(sign | ((bits + 0xFFFU + ((bits >> 13) & 1U)) >> 13));
}

/** A float of 24 bits, from the low 24 of a word (the others are ignored): sign, 5 exponent bits
 * counted from `bias` (shifted by 23), 18 bits of fraction. */
static inline float float24_widen(uint32_t word, uint32_t bias) {
  const uint32_t sign = (word & 0x800000U) << 8;
  return bits_float(sign | (((word & 0x7FFFFFU) << 5) + bias));
}

/** The nearest such float; the smallest where |value| is below all, the largest where above. */
static inline uint32_t float24_narrow(float value, uint32_t bias) {
  const uint32_t sign = (float_bits(value) >> 8) & 0x800000U;
  const uint32_t bits = float_bits(value) & 0x7FFFFFFFU;
  if (bits <= bias) {
    return sign;
  }
  const uint32_t word = (bits - bias + 0xFU + (((bits - bias) >> 5) & 1U)) >> 5;
  return sign | (word > 0x7FFFFFU ? 0x7FFFFFU : word);
}

#endif
