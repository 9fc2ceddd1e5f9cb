/* SPDX-License-Identifier: MIT */
/** @file Load shared libraries at their first use, because linking libraries that few commands need
 * would delay the start of every command. List the functions once,
 *
 *     #define FUNCTIONS(EACH) EACH(cairo_, arc) EACH(cairo_, fill)
 *     static struct { FUNCTIONS(SUPINE_LIBRARY_MEMBER) } cairo;
 *
 * fill the struct with SUPINE_LIBRARY_LOAD, and call cairo.arc(...). */
#ifndef SUPINE_BASE_LIBRARY_H
#define SUPINE_BASE_LIBRARY_H

#include <stddef.h>

#include <supine/status.h>

#define SUPINE_LIBRARY_MEMBER(prefix, function) __typeof__(prefix##function) *function;
#define SUPINE_LIBRARY_NAME(prefix, function) #prefix #function,

/** Load the functions of a list into a struct made by SUPINE_LIBRARY_MEMBER. */
#define SUPINE_LIBRARY_LOAD(library, LIST, members, error)                                         \
  supine_library_load(library, (const char *const[]){LIST(SUPINE_LIBRARY_NAME) NULL}, members,     \
                      error)

/** Do the same with a struct of the caller's own, such as a variable of a function: it need not be
 * zeroed, and nothing is locked, so that a child process may call this. */
#define SUPINE_LIBRARY_LOAD_OWN(library, LIST, members, error)                                     \
  supine_library_load_own(library, (const char *const[]){LIST(SUPINE_LIBRARY_NAME) NULL}, members, \
                          error)

/** Load functions of a shared library, which stays loaded until the process ends.
 * @param library  name of its file, such as "libcairo.so.2"
 * @param names    names of the functions; NULL after the last
 * @param members  pointers to the functions, in the order of the names; zeroed before the first
 * call, written by the first that succeeds Thread-safe. */
supine_status supine_library_load(const char *library, const char *const *names, void *members,
                                  supine_error *error);
supine_status supine_library_load_own(const char *library, const char *const *names, void *members,
                                      supine_error *error);

#endif
