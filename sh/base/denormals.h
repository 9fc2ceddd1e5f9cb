/* SPDX-License-Identifier: MIT */
/** @file
 * Denormal numbers as zero, for the calling thread. */
#ifndef SUPINE_DENORMALS_H
#define SUPINE_DENORMALS_H

/** Sets the processor to treat denormal numbers as zero; returns what to restore. */
unsigned supine_denormals_flush(void);
void supine_denormals_restore(unsigned saved);

#endif
