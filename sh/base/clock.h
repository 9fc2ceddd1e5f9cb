/* SPDX-License-Identifier: MIT */
/** @file A clock for measuring durations. */
#ifndef SUPINE_CLOCK_H
#define SUPINE_CLOCK_H

/** Seconds since some moment in the past; monotonic. */
double supine_clock_seconds(void);

#endif
