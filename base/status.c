/* SPDX-License-Identifier: MIT */
/* Describe status codes in words, and set the detail of an error. */
#include <stdarg.h>
#include <stdio.h>

#include <supine/status.h>

#include "base/number.h"
#include "base/utf8.h"

const char *supine_status_string(supine_status status) {
  static const char *const phrases[] = {
      "success",        "argument out of range", "out of memory",   "cannot read",
      "malformed file", "unusable mesh",         "surface is open", "not supported here",
      "cannot write",   "numerical failure",     "interrupted"};
  _Static_assert(sizeof phrases / sizeof *phrases == SUPINE_STATUS_COUNT,
                 "each status needs a phrase");
  return (unsigned)status < SUPINE_STATUS_COUNT ? phrases[status] : "unknown status";
}

supine_status supine_error_set(supine_error *error, supine_status status, const char *format, ...) {
  if (error != NULL) {
    char message[sizeof error->message];
    va_list arguments;
    va_start(arguments, format);
    (void)supine_print_text_list(message, sizeof message, format, arguments);
    va_end(arguments);
    error->status = status;
    supine_utf8_escape(message, "", error->message, sizeof error->message);
  }
  return status;
}
