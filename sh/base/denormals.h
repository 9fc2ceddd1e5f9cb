/* SPDX-License-Identifier: MIT */
/** @file
 * Denormal numbers as zero, for the calling thread. */
#ifndef SUPINE_DENORMALS_H
#define SUPINE_DENORMALS_H

/** Make the processor treat denormal numbers as zero; return the setting to restore. */
unsigned supine_denormals_flush(void);
void supine_denormals_restore(unsigned saved);

#endif
