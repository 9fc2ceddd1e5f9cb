/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Find the sum of squares, the maximum and percentiles of non-negative numbers without storing
 * them. */
#ifndef SUPINE_TALLY_H
#define SUPINE_TALLY_H

#include <stddef.h>
#include <stdint.h>

/* Number of bins: one for each combination of the 8 exponent bits and the upper 8 mantissa bits of
 * a positive float. Bins are 0.2 to 0.4 % wide. */
enum { SUPINE_TALLY_BINS = 1 << 16 };

typedef struct supine_tally {
  double square_sum;
  double largest;
  uint64_t count;
  uint32_t bins[SUPINE_TALLY_BINS];
} supine_tally;

/* Add `count` values, none of which is negative. */
void supine_projection_tally_add(supine_tally *tally, size_t count, const double *values);

void supine_projection_tally_merge(supine_tally *tally, const supine_tally *other);

/* Return the value below which `share`, 0 to 1, of the numbers lie, rounded up to the edge of its
 * bin. Return 0 if there are no numbers. */
double supine_projection_tally_percentile(const supine_tally *tally, double share);

#endif
