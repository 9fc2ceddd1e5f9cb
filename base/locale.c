/* SPDX-License-Identifier: MIT */
/* Set the C locale for one thread. */
#include "base/locale.h"

#ifdef _WIN32
#include <stdio.h>

supine_locale supine_locale_enter(void) {
  supine_locale before = {.per_thread = _configthreadlocale(_ENABLE_PER_THREAD_LOCALE)};
  (void)snprintf(before.numeric, sizeof before.numeric, "%s", setlocale(LC_NUMERIC, NULL));
  (void)setlocale(LC_NUMERIC, "C");
  return before;
}

void supine_locale_leave(const supine_locale *before) {
  (void)setlocale(LC_NUMERIC, before->numeric);
  (void)_configthreadlocale(before->per_thread);
}
#elif defined(__wasm__) /* no locale is ever set; newlocale would read the environment */
supine_locale supine_locale_enter(void) {
  return (locale_t)0;
}

void supine_locale_leave(const supine_locale *before) {
  (void)before;
}
#else
supine_locale supine_locale_enter(void) {
  /* In glibc and musl this locale is a constant: it is neither allocated nor freed. */
  return uselocale(newlocale(LC_ALL_MASK, "C", (locale_t)0));
}

void supine_locale_leave(const supine_locale *before) {
  (void)uselocale(*before);
}
#endif
