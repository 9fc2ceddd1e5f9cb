/* SPDX-License-Identifier: GPL-3.0-or-later */
/* What clang-tidy is told before each file: supine_error_set returns the status that it is given,
 * which it cannot see from one file alone, and without which each failure might be a success to it.
 */
#include <supine/status.h>
#define supine_error_set(error, status, ...)                                                       \
  ((void)(supine_error_set)((error), (status), __VA_ARGS__), (status))
