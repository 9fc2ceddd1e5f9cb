/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Included by clang-tidy before each file: supine_error_set returns the status that it is given.
 * Without this, clang-tidy takes each failure for a possible success. */
#include <supine/status.h>
#define supine_error_set(error, status, ...)                                                       \
  ((void)(supine_error_set)((error), (status), __VA_ARGS__), (status))
