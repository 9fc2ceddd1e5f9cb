/* SPDX-License-Identifier: MIT */
/* Load a shared library at its first use. */
#include <dlfcn.h>
#include <pthread.h>
#include <stdbool.h>
#include <string.h>

#include "base/arena.h"
#include "base/library.h"

/* One thread at a time loads libraries, as a table of functions belongs to the whole process. */
static pthread_mutex_t loading = PTHREAD_MUTEX_INITIALIZER;

/* Return whether all functions of a table are loaded. A table that is loaded is not written again,
 * so that other threads may use it. */
static bool is_loaded(const char *const *names, const void *members) {
  bool loaded = true;
  for (size_t i = 0; names[i] != NULL; ++i) {
    void *function;
    memcpy(&function, (const char *)members + i * sizeof function, sizeof function);
    loaded = loaded && function != NULL;
  }
  return loaded;
}

supine_status supine_library_load_own(const char *library, const char *const *names, void *members,
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

supine_status supine_library_load(const char *library, const char *const *names, void *members,
                                  supine_error *error) {
  supine_status status = SUPINE_OK;
  (void)pthread_mutex_lock(&loading);
  if (!is_loaded(names, members)) {
    status = supine_library_load_own(library, names, members, error);
  }
  (void)pthread_mutex_unlock(&loading);
  return status;
}
