/* SPDX-License-Identifier: MIT */
/** @file
 * Splitting a range of independent work over threads. */
#ifndef SUPINE_PARALLEL_H
#define SUPINE_PARALLEL_H

#include <stdbool.h>
#include <stddef.h>

/** Works on items begin <= i < end; `thread` is 0 to threads - 1 and names per-thread space. */
typedef void supine_range_function(void *context, size_t begin, size_t end, size_t thread);

/** How many threads to use where the caller gives 0: the processors that this process may run on,
 * or the environment variable SUPINE_THREADS (1 to 256). */
size_t supine_thread_count(void);

/** False where SUPINE_THREADS is set to anything else. */
bool supine_thread_count_sound(void);

/** Calls `function` on consecutive pieces of 0 <= i < count, one piece a thread, and waits.
 *
 * @param count    items
 * @param grain    fewest items worth a thread (at least 1): fewer threads run where count is small
 * @param threads  at most this many; 0: supine_thread_count()
 * Pieces begin at multiples of `grain`. Where a thread cannot be started its piece runs in the
 * caller's, so that the call always completes. The pieces depend on the arguments alone. */
void supine_parallel_for(size_t count, size_t grain, size_t threads,
                         supine_range_function *function, void *context);

#endif
