/* SPDX-License-Identifier: MIT */
/** @file
 * Call libraries that parse or print numbers in the locale of the host program, such as jansson.
 * For the project's own numbers, see base/number.h. */
#ifndef SUPINE_LOCALE_H
#define SUPINE_LOCALE_H

#include <locale.h>
#ifdef __APPLE__
#include <xlocale.h>
#endif

#include "base/arena.h"

/** Set the C locale for the calling thread. Return its locale before. */
locale_t supine_locale_enter(void);

/** Give the calling thread its locale back. */
void supine_locale_leave(const locale_t *before);

/** Declare a variable that keeps the C locale in the calling thread until its scope ends. */
#define SUPINE_C_LOCALE                                                                            \
  SUPINE_FREED_BY(supine_locale_leave) const locale_t supine_locale_before = supine_locale_enter()

#endif
