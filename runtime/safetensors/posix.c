/* SPDX-License-Identifier: MIT */
/* Map files and allocate large memory on POSIX systems. */
#define _DEFAULT_SOURCE /* declares madvise */ // NOLINT(*-reserved-identifier,cert-*)
#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include "runtime/safetensors/platform.h"

supine_status supine_platform_map(const char *path, supine_platform_file *file,
                                  supine_error *error) {
  supine_status status = SUPINE_OK;
  struct stat about = {0};
  *file = (supine_platform_file){NULL, 0};
  /* without O_NONBLOCK, opening a pipe waits for a writer */
  const int descriptor = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (descriptor < 0 || fstat(descriptor, &about) != 0) {
    status =
        supine_error_set(error, SUPINE_ERROR_READ, "%s: cannot read: %s", path, strerror(errno));
  } else if (!S_ISREG(about.st_mode)) {
    status = supine_error_set(error, SUPINE_ERROR_READ,
                              "%s: not a regular file: give the path of a safetensors file", path);
  } else if (about.st_size > 0) { /* do not map an empty file: mapping would fail */
    void *bytes = mmap(NULL, (size_t)about.st_size, PROT_READ, MAP_PRIVATE, descriptor, 0);
    if (bytes == MAP_FAILED) {
      status = supine_error_set(error, SUPINE_ERROR_READ, "%s: cannot map the file into memory: %s",
                                path, strerror(errno));
    } else {
      *file = (supine_platform_file){bytes, (size_t)about.st_size};
    }
  }
  if (descriptor >= 0) {
    (void)close(descriptor);
  }
  return status;
}

void supine_platform_unmap(const supine_platform_file *file) {
  if (file->bytes != NULL) {
    (void)munmap((void *)file->bytes, file->size);
  }
}

void *supine_platform_allocate(size_t bytes) {
  enum { LINE = 64, HUGE_PAGE = 1 << 21 };
  const size_t alignment = bytes >= 2 * (size_t)HUGE_PAGE ? HUGE_PAGE : LINE;
  const size_t rounded = (bytes + alignment - 1) / alignment * alignment;
  void *memory = aligned_alloc(alignment, rounded);
#ifdef MADV_HUGEPAGE
  if (memory != NULL && alignment == HUGE_PAGE) {
    (void)madvise(memory, rounded, MADV_HUGEPAGE);
  }
#endif
  return memory;
}

void supine_platform_free(void *memory) {
  free(memory);
}
