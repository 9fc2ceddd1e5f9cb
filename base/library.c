/* SPDX-License-Identifier: MIT */
/* Load a shared library at its first use. */
#include <dlfcn.h>
#include <string.h>

#include "base/arena.h"
#include "base/library.h"

supine_status supine_library_load(const char *library, const char *const *names, void *members,
                                  supine_error *error) {
  void *handle = dlopen(library, RTLD_LAZY);
  for (size_t i = 0; names[i] != NULL; ++i) {
    void *function = handle != NULL ? dlsym(handle, names[i]) : NULL;
    SUPINE_REFUSE_IF(function == NULL, error, SUPINE_ERROR_UNSUPPORTED,
                     "%s cannot be loaded: install it", library);
    memcpy((char *)members + i * sizeof function, &function, sizeof function);
  }
  return SUPINE_OK;
}
