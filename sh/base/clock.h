/* SPDX-License-Identifier: MIT */
/** @file
 * A clock for measuring how long things take. */
#ifndef SUPINE_CLOCK_H
#define SUPINE_CLOCK_H

/** Seconds since some moment in the past; never runs backwards. */
double supine_clock_seconds(void);

#endif
