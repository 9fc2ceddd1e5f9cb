/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Count latencies in a histogram, and compute quantiles. */
#ifndef SUPINE_STREAM_LATENCY_H
#define SUPINE_STREAM_LATENCY_H

#include <stddef.h>
#include <stdint.h>

enum { SUPINE_STREAM_LATENCY_BINS = 65536 }; /**< of 1 us each; the last also counts longer ones */

typedef struct supine_stream_latency {
  uint64_t count;
  double worst; /**< s */
  uint32_t bin[SUPINE_STREAM_LATENCY_BINS];
} supine_stream_latency;

void supine_stream_latency_add(supine_stream_latency *latency, double seconds);

/** Return the quantile `share` (0 to 1), s, rounded up to a microsecond; beyond the last bin the
 * worst latency; 0 where none was added. */
double supine_stream_latency_share(const supine_stream_latency *latency, double share);

#endif
