/* SPDX-License-Identifier: MIT */
/** @file
 * Numbers in fewer bits: two or three numbers in a word of 32 bits; three in two words.
 * Plain C, one at a time.
 *
 * A number that shares a word stands in its upper bits and is read as the whole word, a signed
 * integer, so that reading costs one conversion: what stands below is noise that is known when the
 * number is chosen, and it is chosen so that both together come nearest. */
#ifndef SUPINE_COMPACT_H
#define SUPINE_COMPACT_H

#include <math.h>
#include <stddef.h>
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

/** The integer that `word` stands for. */
static inline int32_t word_integer(uint32_t word) {
  int32_t value = 0;
  memcpy(&value, &word, sizeof value);
  return value;
}

/** rint of what is far below 2^51, in instructions that every processor has. */
static inline double nearest_integer(double value) {
  return (value + 0x1.8p52) - 0x1.8p52;
}

/** The word nearest to `value` with the given lowest `bits`, which are all that is set in `low`. */
static inline uint32_t word_nearest(double value, uint32_t low, int bits) {
  const double step = (double)(UINT32_C(1) << bits);
  const double top = 0x1p31 / step - 1;
  const double above = nearest_integer((value - (double)low) / step);
  const double held = above > top ? top : above >= -top - 1 ? above : -top - 1; /* or NaN */
  return (uint32_t)(int32_t)(held * step) | low;
}

/** Two numbers in a word, in units of 2^-31 of their limits: the first in the lower half. */
static inline uint32_t pair_narrow(double first, double second) {
  return word_nearest(second, word_nearest(first, 0, 16) >> 16, 16);
}

/** @{ The numbers of a pair. */
static inline float pair_first(uint32_t word) {
  return (float)word_integer(word << 16);
}

static inline float pair_second(uint32_t word) {
  return (float)word_integer(word);
}
/** @} */

/** Three numbers in a word, likewise: 11, 11 and 10 bits from the uppermost. */
static inline uint32_t triple_narrow(double first, double second, double third) {
  const uint32_t low = word_nearest(third, 0, 22) >> 22;
  const uint32_t lower = word_nearest(second, low << 11, 21) >> 11;
  return word_nearest(first, lower, 21);
}

/** Number 0, 1 or 2 of a triple. */
static inline float triple_number(uint32_t word, size_t number) {
  return (float)word_integer(word << 11 * number);
}

/** Three modes of a normal in a word, likewise: 13, 10 and 9 bits from the uppermost, as the first
 * modes are the large ones. */
static inline uint32_t normal_narrow(double first, double second, double third) {
  const uint32_t low = word_nearest(third, 0, 23) >> 23;
  const uint32_t lower = word_nearest(second, low << 13, 22) >> 13;
  return word_nearest(first, lower, 19);
}

/** What one unit of such a word stands for, of a file's 16 bits: the largest of those, 32767, comes
 * to the largest that 9 bits in the upper end of a word can hold, 255 x 2^23. */
static inline double normal_unit(void) {
  return INT16_MAX / (255 * 0x1p23);
}

/** Number 0, 1 or 2 of those. */
static inline float normal_number(uint32_t word, size_t number) {
  return (float)word_integer(word << (number == 0 ? 0 : number == 1 ? 13 : 23));
}

/** Three numbers in two words, in units of 2^-31 of their limit: the first and second in the upper
 * 21 bits of a word each, the third in what is left of both. None becomes 0 (see fixed_scale). */
static inline void fixed_narrow(const double *numbers, uint32_t *words) {
  uint32_t third = word_nearest(numbers[2], 0, 10);
  third = third == 0 ? UINT32_C(1) << 10 : third;
  for (int i = 0; i < 2; ++i) {
    const uint32_t low = third >> (i == 0 ? 21 : 10) & 0x7FFU;
    words[i] = word_nearest(numbers[i], low, 11);
    words[i] = words[i] == 0 ? UINT32_C(1) << 11 : words[i];
  }
}

/** The three numbers. */
static inline void fixed_widen(const uint32_t *words, float *numbers) {
  numbers[0] = (float)word_integer(words[0]);
  numbers[1] = (float)word_integer(words[1]);
  numbers[2] = (float)word_integer(words[0] << 21 | (words[1] << 10 & 0x1FFC00U));
}

/** A number other than 0 times the power of two whose exponent, in its place in a float's bits, is
 * `unit`. */
static inline float fixed_scale(float number, uint32_t unit) {
  return bits_float(float_bits(number) + unit);
}

#endif
