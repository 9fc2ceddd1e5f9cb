/* SPDX-License-Identifier: MIT */
/** @file
 * Compact numbers: two or three numbers in a 32-bit word, or three numbers in two words.
 *
 * To read a number, shift its word left until the number has the uppermost bits, and convert the
 * whole word as a signed integer. The bits below the number, which belong to other numbers, act as
 * a rounding error. When a number is packed, the bits below it are already known. Packing chooses
 * the bits of the number so that the integer read later is as near as possible to the number. */
#ifndef SUPINE_COMPACT_H
#define SUPINE_COMPACT_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

/** Return the bits of a word as a signed integer. */
static inline int32_t word_integer(uint32_t word) {
  int32_t value = 0;
  memcpy(&value, &word, sizeof value);
  return value;
}

/** Round a number of magnitude below 2^51 to the nearest integer, by two additions. */
static inline double nearest_integer(double value) {
  return (value + 0x1.8p52) - 0x1.8p52;
}

/** Return the signed 32-bit integer nearest to `value` whose lowest `bits` bits are those of `low`.
 * For NaN, return the smallest of these integers. */
static inline uint32_t word_nearest(double value, uint32_t low, int bits) {
  const double step = (double)(UINT32_C(1) << bits);
  const double top = 0x1p31 / step - 1;
  const double above = nearest_integer((value - (double)low) / step);
  double held = -top - 1; /* also for NaN */
  if (above > top) {
    held = top;
  } else if (above >= -top - 1) {
    held = above;
  }
  return (uint32_t)(int32_t)(held * step) | low;
}

/** Pack two numbers between -2^31 and 2^31 into a word, rounded to 16 bits each. The first number
 * gets the lower half of the word. */
static inline uint32_t pair_narrow(double first, double second) {
  return word_nearest(second, word_nearest(first, 0, 16) >> 16, 16);
}

/** Pack three numbers between -2^31 and 2^31 into a word, rounded to 11, 11 and 10 bits. The first
 * number gets the uppermost bits. */
static inline uint32_t triple_narrow(double first, double second, double third) {
  const uint32_t low = word_nearest(third, 0, 22) >> 22;
  const uint32_t lower = word_nearest(second, low << 11, 21) >> 11;
  return word_nearest(first, lower, 21);
}

/** Pack three numbers between -2^31 and 2^31 into a word, rounded to 13, 10 and 9 bits. The first
 * gets the uppermost bits. The numbers are coordinates of vectors whose weighted sum is a normal
 * (supine_basis_info.normals); the first tends to be the largest. */
static inline uint32_t normal_narrow(double first, double second, double third) {
  const uint32_t low = word_nearest(third, 0, 23) >> 23;
  const uint32_t lower = word_nearest(second, low << 13, 22) >> 13;
  return word_nearest(first, lower, 19);
}

/** Return the scale from the numbers packed by normal_narrow to the 16-bit numbers of the file. 255
 * x 2^23, the largest integer whose lowest 23 bits are 0, becomes 32767. */
static inline double normal_unit(void) {
  return INT16_MAX / (255 * 0x1p23);
}

/** Return number k of `count` numbers of 16 bits that a file stores in count + 1 bytes
 * (supine_basis_info.normals). */
static inline int normal_from_bytes(const int8_t *bytes, size_t count, size_t k) {
  return 256 * bytes[k] + (k == 0 ? bytes[count] : 0);
}

/** Return number 0, 1 or 2 of the three numbers that normal_narrow packed into `word`. */
static inline float normal_number(uint32_t word, size_t number) {
  static const unsigned begin[] = {0, 13, 23}; /* first bit of each number, from the highest */
  return (float)word_integer(word << begin[number]);
}

/** Pack three numbers between -2^31 and 2^31 into two words. The first two numbers get the upper 21
 * bits of a word each, the third number gets the remaining 22 bits. A number that would become 0
 * becomes the smallest positive number: the kernels multiply floats by powers of two by adding to
 * the exponent bits, which does not leave 0 unchanged. */
static inline void fixed_narrow(const double *numbers, uint32_t *words) {
  uint32_t third = word_nearest(numbers[2], 0, 10);
  third = third == 0 ? UINT32_C(1) << 10 : third;
  for (int i = 0; i < 2; ++i) {
    const uint32_t low = third >> (i == 0 ? 21 : 10) & 0x7FFU;
    words[i] = word_nearest(numbers[i], low, 11);
    words[i] = words[i] == 0 ? UINT32_C(1) << 11 : words[i];
  }
}

/** Unpack the three numbers that fixed_narrow packed into two words. */
static inline void fixed_widen(const uint32_t *words, float *numbers) {
  numbers[0] = (float)word_integer(words[0]);
  numbers[1] = (float)word_integer(words[1]);
  numbers[2] = (float)word_integer(words[0] << 21 | (words[1] << 10 & 0x1FFC00U));
}

#endif
