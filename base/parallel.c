/* SPDX-License-Identifier: MIT */
/* Split independent work over POSIX threads. */
#define _GNU_SOURCE /* declares sched_getaffinity */ // NOLINT(*-reserved-identifier,cert-*)
#include <pthread.h>
#include <sched.h>
#include <stdbool.h>
#include <stdlib.h>
#include <unistd.h>

#include "base/parallel.h"

enum { THREADS_MAX = 256 };

typedef struct piece {
  supine_range_function *function;
  void *context;
  size_t begin, end, thread;
} piece;

static void *piece_run(void *argument) {
  const piece *work = argument;
  work->function(work->context, work->begin, work->end, work->thread);
  return NULL;
}

/* Read SUPINE_THREADS; return 0 if it is not set, -1 if it is not a number from 1 to 256. */
static long requested_threads(void) {
  const char *text = getenv("SUPINE_THREADS"); /* NOLINT(concurrency-mt-unsafe) */
  if (text == NULL) {
    return 0;
  }
  char *end = NULL;
  const long value = strtol(text, &end, 10);
  return end != text && *end == '\0' && value >= 1 && value <= THREADS_MAX ? value : -1;
}

bool supine_thread_count_is_valid(void) {
  return requested_threads() >= 0;
}

size_t supine_thread_count(void) {
  const long requested = requested_threads();
  if (requested > 0) {
    return (size_t)requested;
  }
  long count = sysconf(_SC_NPROCESSORS_ONLN);
#ifdef CPU_COUNT /* Linux: a container or a scheduler may allow only some of the processors */
  cpu_set_t allowed;
  if (sched_getaffinity(0, sizeof allowed, &allowed) == 0) {
    count = CPU_COUNT(&allowed);
  }
#endif
  if (count < 1) {
    return 1;
  }
  return count > THREADS_MAX ? THREADS_MAX : (size_t)count;
}

void supine_parallel_for(size_t count, size_t grain, size_t threads,
                         supine_range_function *function, void *context) {
  if (count == 0) {
    return;
  }
  const size_t grains = (count - 1) / grain + 1;
  size_t used = threads == 0 ? supine_thread_count() : threads;
  used = used > grains ? grains : used;
  used = used > THREADS_MAX ? THREADS_MAX : used;
  if (used <= 1) {
    function(context, 0, count, 0);
    return;
  }
  pthread_t handles[THREADS_MAX];
  piece pieces[THREADS_MAX];
  bool started[THREADS_MAX] = {false};
  for (size_t t = 0; t < used; ++t) {
    const size_t last = grains * (t + 1) / used * grain;
    pieces[t] =
        (piece){function, context, grains * t / used * grain, last < count ? last : count, t};
  }
  for (size_t t = 1; t < used; ++t) {
    started[t] = pthread_create(&handles[t], NULL, piece_run, &pieces[t]) == 0;
  }
  (void)piece_run(&pieces[0]);
  for (size_t t = 1; t < used; ++t) {
    if (started[t]) {
      (void)pthread_join(handles[t], NULL);
    } else {
      (void)piece_run(&pieces[t]);
    }
  }
}
