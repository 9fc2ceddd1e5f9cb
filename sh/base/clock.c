/* SPDX-License-Identifier: MIT */
/* A clock for measuring durations. */
#include <time.h>

#include "sh/base/clock.h"

double supine_clock_seconds(void) {
  struct timespec time;
  (void)clock_gettime(CLOCK_MONOTONIC, &time);
  return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
}
