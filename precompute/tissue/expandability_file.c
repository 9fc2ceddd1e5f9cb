/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Expandability from a file: a value a line, or a vertex and its value. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "precompute/tissue/expandability.h"

/* Where reading stands. A value of 0 is one that has not come yet. */
typedef struct reader {
  const char *path;
  size_t line;
  size_t count;
  size_t next; /* vertex of the next bare value */
  bool header, named;
  double *a;
  supine_error *error;
} reader;

static supine_status bad_number(const reader *in, const char *text) {
  return supine_error_set(in->error, SUPINE_ERROR_FORMAT,
                          "%s:%zu: '%.40s' is not a number (a line is a value, or vertex,value)",
                          in->path, in->line, text);
}

/* "vertex,value" at the front of a line; where they end, or NULL. */
static const char *scan_vertex(const char *text, unsigned long long *vertex) {
  char *end = NULL;
  errno = 0;
  *vertex = strtoull(text, &end, 10);
  const bool good = end != text && errno == 0 && strchr(text, '-') != text;
  return good && *end == ',' ? end + 1 : NULL;
}

static supine_status take_value(reader *in, size_t vertex, const char *text) {
  char *end = NULL;
  const double value = strtod(text, &end);
  if (end == text || *(end + strspn(end, " \t\r")) != '\0') {
    return bad_number(in, text);
  }
  if (vertex >= in->count) {
    return supine_error_set(in->error, SUPINE_ERROR_FORMAT,
                            "%s:%zu: vertex %zu, but the model has %zu, counted from 0", in->path,
                            in->line, vertex, in->count);
  }
  if (!(value > 0.0) || !isfinite(value) || !isfinite(1.0 / value)) {
    return supine_error_set(in->error, SUPINE_ERROR_FORMAT,
                            "%s:%zu: expandability of vertex %zu is %g: it must be positive and "
                            "finite",
                            in->path, in->line, vertex, value);
  }
  if (in->a[vertex] != 0.0) {
    return supine_error_set(in->error, SUPINE_ERROR_FORMAT,
                            "%s:%zu: vertex %zu has a value already", in->path, in->line, vertex);
  }
  in->a[vertex] = value;
  return SUPINE_OK;
}

/* One line without its end. The header's number of columns says which of the two forms follows. */
static supine_status take_line(reader *in, char *text) {
  const char *front = text + strspn(text, " \t\r");
  if (*front == '\0' || *front == '#') {
    return SUPINE_OK;
  }
  if (!in->header) {
    char *end = NULL;
    (void)strtod(front, &end);
    if (end != front) {
      return supine_error_set(in->error, SUPINE_ERROR_FORMAT,
                              "%s:%zu: a header line must come first: 'expandability', or "
                              "'vertex,expandability'",
                              in->path, in->line);
    }
    in->header = true;
    in->named = strchr(front, ',') != NULL;
    return SUPINE_OK;
  }
  if (!in->named) {
    return take_value(in, in->next++, front);
  }
  unsigned long long vertex = 0;
  const char *value = scan_vertex(front, &vertex);
  return value == NULL ? bad_number(in, front) : take_value(in, (size_t)vertex, value);
}

static supine_status check_all_there(const reader *in) {
  for (size_t i = 0; i < in->count; ++i) {
    if (in->a[i] == 0.0) {
      return supine_error_set(in->error, SUPINE_ERROR_FORMAT,
                              "%s: vertex %zu of %zu has no expandability", in->path, i, in->count);
    }
  }
  return SUPINE_OK;
}

supine_status supine_tissue_expandability_load(const char *path, size_t count, double *a,
                                               supine_error *error) {
  reader in = {.path = path, .count = count, .a = a, .error = error};
  char *text = NULL;
  size_t capacity = 0;
  supine_status status = SUPINE_OK;
  FILE *file = fopen(path, "rbe");
  if (file == NULL) {
    return supine_error_set(error, SUPINE_ERROR_READ, "%s: %s", path,
                            strerror(errno)); /* NOLINT(concurrency-mt-unsafe) */
  }
  memset(a, 0, count * sizeof *a);
  for (;;) {
    errno = 0;
    const ssize_t length = getline(&text, &capacity, file);
    if (length < 0) {
      break;
    }
    ++in.line;
    if (memchr(text, '\0', (size_t)length) != NULL) {
      status =
          supine_error_set(error, SUPINE_ERROR_FORMAT, "%s:%zu: not a text file", path, in.line);
      goto cleanup;
    }
    text[strcspn(text, "\n")] = '\0';
    status = take_line(&in, text);
    if (status != SUPINE_OK) {
      goto cleanup;
    }
  }
  status = errno == 0 || feof(file) != 0
               ? check_all_there(&in)
               : supine_error_set(error, SUPINE_ERROR_READ, "%s: %s", path,
                                  strerror(errno)); /* NOLINT(concurrency-mt-unsafe) */
cleanup:
  free(text);
  (void)fclose(file);
  return status;
}
