/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Count latencies in a histogram, and compute quantiles. */
#include <math.h>

#include "program/stream/latency.h"

void supine_stream_latency_add(supine_stream_latency *latency, double seconds) {
  const double microseconds = fmax(0.0, 1e6 * seconds);
  const size_t last = SUPINE_STREAM_LATENCY_BINS - 1;
  ++latency->bin[microseconds < (double)last ? (size_t)microseconds : last];
  ++latency->count;
  latency->worst = fmax(latency->worst, seconds);
}

double supine_stream_latency_share(const supine_stream_latency *latency, double share) {
  const double wanted = ceil(share * (double)latency->count);
  double passed = 0.0;
  for (size_t i = 0; i + 1 < SUPINE_STREAM_LATENCY_BINS; ++i) {
    passed += (double)latency->bin[i];
    if (passed >= wanted && passed > 0.0) {
      return fmin(latency->worst, 1e-6 * (double)(i + 1));
    }
  }
  return latency->worst;
}
