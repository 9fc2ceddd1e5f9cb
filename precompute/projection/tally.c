/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Find percentiles of many numbers from a histogram. */
#include <math.h>
#include <string.h>

#include "precompute/projection/tally.h"

enum { BIN_SHIFT = 15 };

void supine_projection_tally_add(supine_tally *tally, size_t count, const double *values) {
  double square_sum = 0.0;
  double largest = tally->largest;
  for (size_t i = 0; i < count; ++i) {
    const float single = (float)values[i];
    uint32_t bits;
    memcpy(&bits, &single, sizeof bits);
    square_sum += values[i] * values[i];
    largest = values[i] > largest ? values[i] : largest;
    ++tally->bins[bits >> BIN_SHIFT];
  }
  tally->square_sum += square_sum;
  tally->largest = largest;
  tally->count += count;
}

void supine_projection_tally_merge(supine_tally *tally, const supine_tally *other) {
  tally->square_sum += other->square_sum;
  tally->largest = fmax(tally->largest, other->largest);
  tally->count += other->count;
  for (size_t b = 0; b < SUPINE_TALLY_BINS; ++b) {
    tally->bins[b] += other->bins[b];
  }
}

double supine_projection_tally_percentile(const supine_tally *tally, double share) {
  const double wanted = share * (double)tally->count;
  uint64_t seen = 0;
  for (uint32_t b = 0; b < SUPINE_TALLY_BINS; ++b) {
    seen += tally->bins[b];
    if (seen > 0 && (double)seen >= wanted) {
      const uint32_t bits = (b + 1) << BIN_SHIFT;
      float edge;
      memcpy(&edge, &bits, sizeof edge);
      return (double)edge;
    }
  }
  return 0.0;
}
