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
    char message[4 * sizeof error->message]; /* with room for numbers before they are shortened */
    va_list arguments;
    va_start(arguments, format);
    (void)supine_print_text_list(message, sizeof message, format, arguments);
    va_end(arguments);
    supine_number_shorten(message);
    error->status = status;
    error->remedy = SUPINE_REMEDY_NONE;
    error->value[0] = '\0';
    supine_utf8_escape(message, "", error->message, sizeof error->message);
  }
  return status;
}

void supine_error_advise(supine_error *error, supine_remedy remedy, const char *value) {
  if (error != NULL) {
    error->remedy = remedy;
    (void)snprintf(error->value, sizeof error->value, "%s", value != NULL ? value : "");
  }
}

supine_status supine_error_wrap(supine_error *error, const supine_error *cause, const char *format,
                                ...) {
  char text[sizeof cause->message];
  va_list arguments;
  va_start(arguments, format);
  (void)supine_print_text_list(text, sizeof text, format, arguments);
  va_end(arguments);
  (void)supine_error_set(error, cause->status, "%s%s", text, cause->message);
  supine_error_advise(error, cause->remedy, cause->value);
  return cause->status;
}
