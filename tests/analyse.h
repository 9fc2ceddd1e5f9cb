/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Tell clang-tidy that supine_error_set returns its `status` argument. Without this, clang-tidy
 * assumes that a failing function may return SUPINE_OK. tests/analyse.sh includes this file before
 * each source. */
#include <supine/status.h>
#define supine_error_set(error, status, ...)                                                       \
  ((void)(supine_error_set)((error), (status), __VA_ARGS__), (status))
