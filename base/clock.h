/* SPDX-License-Identifier: MIT */
/** @file A clock for measuring durations. */
#ifndef SUPINE_CLOCK_H
#define SUPINE_CLOCK_H

#include <time.h>

/** Return the time in seconds since an arbitrary moment. It never decreases. */
static inline double supine_clock_seconds(void) {
  struct timespec time;
  (void)clock_gettime(CLOCK_MONOTONIC, &time);
  return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
}

#endif
