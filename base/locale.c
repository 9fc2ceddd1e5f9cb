/* SPDX-License-Identifier: MIT */
/* Set the C locale for one thread. */
#include "base/locale.h"

locale_t supine_locale_enter(void) {
  /* In glibc and musl this locale is a constant: it is neither allocated nor freed. */
  return uselocale(newlocale(LC_ALL_MASK, "C", (locale_t)0));
}

void supine_locale_leave(const locale_t *before) {
  (void)uselocale(*before);
}
