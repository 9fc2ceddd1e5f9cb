/* SPDX-License-Identifier: MIT */
/* Status codes in words, and the detail of an error. */
#include <stdarg.h>
#include <stdio.h>

#include <supine/status.h>

const char *supine_status_string(supine_status status) {
  switch (status) {
  case SUPINE_OK:
    return "success";
  case SUPINE_ERROR_ARGUMENT:
    return "argument out of range";
  case SUPINE_ERROR_MEMORY:
    return "out of memory";
  case SUPINE_ERROR_READ:
    return "cannot read";
  case SUPINE_ERROR_FORMAT:
    return "malformed file";
  case SUPINE_ERROR_MESH:
    return "unusable mesh";
  case SUPINE_ERROR_OPEN_SURFACE:
    return "surface is not closed";
  case SUPINE_ERROR_UNSUPPORTED:
    return "not supported by this build";
  case SUPINE_ERROR_WRITE:
    return "cannot write";
  case SUPINE_ERROR_NUMERICAL:
    return "numerical failure";
  case SUPINE_ERROR_INTERRUPTED:
    return "interrupted";
  case SUPINE_STATUS_COUNT:
    break;
  }
  return "unknown status";
}

supine_status supine_error_set(supine_error *error, supine_status status, const char *format, ...) {
  if (error != NULL) {
    va_list arguments;
    va_start(arguments, format);
    error->status = status;
    (void)vsnprintf(error->message, sizeof error->message, format, arguments);
    va_end(arguments);
  }
  return status;
}
