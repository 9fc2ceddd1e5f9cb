/* SPDX-License-Identifier: MIT */
/** @file Split independent work over threads. */
#ifndef SUPINE_PARALLEL_H
#define SUPINE_PARALLEL_H

#include <stdbool.h>
#include <stddef.h>

/** A function that processes the items begin <= i < end. `thread` is the index of its thread, from
 * 0. */
typedef void supine_range_function(void *context, size_t begin, size_t end, size_t thread);

/** Return the default number of threads: the environment variable SUPINE_THREADS (1 to 256). If it
 * is not set or not valid, return the number of processors that this process may use. */
size_t supine_thread_count(void);

/** Return whether the environment variable SUPINE_THREADS is unset or valid. */
bool supine_thread_count_is_valid(void);

/** Split the items 0 <= i < count into consecutive ranges, one for each thread. Call `function` on
 * each range, and wait.
 * @param count    number of items
 * @param grain    smallest number of items for a thread, at least 1; small counts use fewer threads
 * @param threads  largest number of threads; 0 selects supine_thread_count()
 *
 * Ranges begin at multiples of `grain`, and depend only on the arguments and the number of threads.
 * If a thread cannot be started, its range runs in the caller's thread. */
void supine_parallel_for(size_t count, size_t grain, size_t threads,
                         supine_range_function *function, void *context);

#endif
