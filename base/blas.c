/* SPDX-License-Identifier: MIT */
/* Reserve the buffers of OpenBLAS before its first use. */
#define _DEFAULT_SOURCE /* declares MAP_ANONYMOUS */ // NOLINT(*-reserved-identifier,cert-*)
#include <pthread.h>
#include <stdbool.h>
#include <sys/mman.h>
#include <sys/resource.h>

#include "base/arena.h"
#include "base/blas.h"

enum { THREADS_MAX = 256 };

/* Size of a buffer of OpenBLAS for x86-64, bytes; those for other processors are not larger. */
static const size_t buffer_size = (size_t)128 << 20;

/* Functions that OpenBLAS exports without a declaration. NULL in other libraries than OpenBLAS. */
extern void *blas_memory_alloc(int caller) __attribute__((weak));
extern void blas_memory_free(void *buffer) __attribute__((weak));

/* Return whether `count` buffers can be mapped at the same time. Map them one by one, because the
 * kernel refuses a single mapping that is larger than its memory. */
static bool can_map(size_t count) {
  void *mapped[THREADS_MAX];
  size_t made = 0;
  for (; made < count; ++made) {
    mapped[made] =
        mmap(NULL, buffer_size, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (mapped[made] == MAP_FAILED) {
      break;
    }
  }
  for (size_t i = 0; i < made; ++i) {
    (void)munmap(mapped[i], buffer_size);
  }
  return made == count;
}

/* Take the first `count` buffers of OpenBLAS at the same time, which maps them, and give them back.
 * OpenBLAS then hands out these buffers again. */
static void take_buffers(size_t count) {
  void *taken[THREADS_MAX];
  for (size_t i = 0; i < count; ++i) {
    taken[i] = blas_memory_alloc(0);
  }
  for (size_t i = 0; i < count; ++i) {
    if (taken[i] != NULL) {
      blas_memory_free(taken[i]);
    }
  }
}

static supine_status refuse(size_t missing, size_t threads, supine_error *error) {
  struct rlimit addresses;
  const size_t needed = missing * (buffer_size >> 20);
  const char *plural = threads == 1 ? "" : "s";
  const char *fewer = threads == 1 ? "" : ", or set SUPINE_THREADS to a smaller number";
  const bool is_limited =
      getrlimit(RLIMIT_AS, &addresses) == 0 && addresses.rlim_cur != RLIM_INFINITY;
  SUPINE_REFUSE_IF(
      !is_limited, error, SUPINE_ERROR_MEMORY,
      "OpenBLAS needs another %zu MiB of memory for %zu thread%s, and the system does not give it: "
      "close other programs%s",
      needed, threads, plural, fewer);
  return supine_error_set(error, SUPINE_ERROR_MEMORY,
                          "OpenBLAS needs another %zu MiB of addresses for %zu thread%s, and the "
                          "limit of the process is %llu MiB: raise it (ulimit -v)%s",
                          needed, threads, plural, (unsigned long long)(addresses.rlim_cur >> 20),
                          fewer);
}

supine_status supine_blas_reserve(size_t threads, supine_error *error) {
  /* Number of buffers that OpenBLAS has mapped here. They belong to the process, as OpenBLAS
   * does. */
  static size_t reserved;
  static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
  supine_status status = SUPINE_OK;
  (void)pthread_mutex_lock(&lock);
  if (threads > reserved && threads <= THREADS_MAX) {
    if (!can_map(threads - reserved)) {
      status = refuse(threads - reserved, threads, error);
    } else if (blas_memory_alloc != NULL && blas_memory_free != NULL) {
      take_buffers(threads);
      reserved = threads;
    }
  }
  (void)pthread_mutex_unlock(&lock);
  return status;
}
