/* SPDX-License-Identifier: MIT */
/** @file
 * Call functions that parse or print numbers, which use the locale of the host program, in the C
 * locale of the calling thread. For the project's own numbers, see base/number.h. */
#ifndef SUPINE_LOCALE_H
#define SUPINE_LOCALE_H

#include <locale.h>
#ifdef __APPLE__
#include <xlocale.h>
#endif

#ifdef _WIN32
/** Whether the thread had a locale of its own, and its decimal mark's locale. */
typedef struct supine_locale {
  int per_thread;
  char numeric[64];
} supine_locale;
#else
typedef locale_t supine_locale;
#endif

/** Set the C locale for the calling thread. Return its locale before. */
supine_locale supine_locale_enter(void);

/** Give the calling thread its locale back. */
void supine_locale_leave(const supine_locale *before);

/** Declare a variable that keeps the C locale in the calling thread until its scope ends. */
#define SUPINE_C_LOCALE                                                                            \
  __attribute__((cleanup(supine_locale_leave), unused)) const supine_locale supine_locale_before = \
      supine_locale_enter()

#endif
