/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * How long frames took: counts by the microsecond, so that memory stays as it is. */
#ifndef SUPINE_STREAM_LATENCY_H
#define SUPINE_STREAM_LATENCY_H

#include <stddef.h>
#include <stdint.h>

enum { SUPINE_STREAM_LATENCY_BINS = 65536 }; /**< of 1 us; later ones count in the last */

typedef struct supine_stream_latency {
  uint64_t count;
  double worst; /**< s */
  uint32_t bin[SUPINE_STREAM_LATENCY_BINS];
} supine_stream_latency;

void supine_stream_latency_add(supine_stream_latency *latency, double seconds);

/** The time that a share of the frames did not exceed, s, to the microsecond above; past the last
 * bin, the worst. 0 where there are none. */
double supine_stream_latency_share(const supine_stream_latency *latency, double share);

#endif
