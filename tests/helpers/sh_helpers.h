/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Pseudo-random numbers, directions and rotations from a seed. */
#ifndef SH_HELPERS_H
#define SH_HELPERS_H

#include <math.h>
#include <stdint.h>

/* Return a uniform number in [-1, 1). G. Marsaglia, "Xorshift RNGs", J. Stat. Software 8(14),
 * 2003. */
static inline double random_signed(uint64_t *seed) {
  *seed ^= *seed << 13;
  *seed ^= *seed >> 7;
  *seed ^= *seed << 17;
  return (double)(*seed >> 11) * 0x1p-52 - 1;
}

/* Choose a direction uniformly on the sphere, by uniform z and longitude (Archimedes). */
static inline void random_direction(uint64_t *seed, double direction[3]) {
  const double z = random_signed(seed);
  const double longitude = M_PI * random_signed(seed);
  const double sine = sqrt((1 - z) * (1 + z));
  direction[0] = sine * cos(longitude);
  direction[1] = sine * sin(longitude);
  direction[2] = z;
}

/* Make a random rotation matrix r from a random unit quaternion. */
static inline void random_rotation(uint64_t *seed, double r[3][3]) {
  double q[4];
  double length = 0;
  for (int i = 0; i < 4; ++i) {
    q[i] = random_signed(seed);
    length += q[i] * q[i];
  }
  length = sqrt(length);
  const double w = q[0] / length;
  const double x = q[1] / length;
  const double y = q[2] / length;
  const double z = q[3] / length;
  const double rows[3][3] = {
      {1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)},
      {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)},
      {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)},
  };
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      r[i][j] = rows[i][j];
    }
  }
}

#endif
