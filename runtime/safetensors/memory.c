/* SPDX-License-Identifier: MIT */
/* Allocate memory, and refuse to map files, on systems without files, such as WebAssembly. */
#include <stdlib.h>

#include "runtime/safetensors/platform.h"

supine_status supine_safetensors_platform_map(const char *path,
                                              supine_safetensors_platform_file *file,
                                              supine_error *error) {
  *file = (supine_safetensors_platform_file){NULL, 0};
  return supine_error_set(error, SUPINE_ERROR_READ,
                          "%s: this system cannot open files: pass the bytes of the file instead",
                          path);
}

void supine_safetensors_platform_unmap(const supine_safetensors_platform_file *file) {
  (void)file;
}

void *supine_safetensors_platform_allocate(size_t bytes) {
  enum { LINE = 64 };
  return aligned_alloc(LINE, (bytes + LINE - 1) / LINE * LINE);
}

void supine_safetensors_platform_free(void *memory) {
  free(memory);
}
