/* SPDX-License-Identifier: MIT */
/* Small CSV files: lists of fields, samples, parameters. */
#ifndef SUPINE_CSV_H
#define SUPINE_CSV_H

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

#include <supine/status.h>

enum { SUPINE_CSV_FIELDS_MAX = 64 };

/* A reader of small CSV files: comments, blank lines, one header, quoted fields. The header
 * determines the separator: ',', ';' (then numbers may have a decimal comma) or tab.
 * Zero-initialise. */
typedef struct supine_csv {
  const char *path;
  FILE *file;
  char *text;
  size_t capacity;
  size_t line;
  char separator;
  size_t field_count;
  char *field[SUPINE_CSV_FIELDS_MAX]; /* fields of the last row read */
  size_t column_count;
  size_t
      column[SUPINE_CSV_FIELDS_MAX]; /* index of the field of each expected column; SIZE_MAX: none
                                      */
} supine_csv;

/* Open the file and read the header, which must have the first `required` of `names`, in any
 * case; other columns are ignored. */
supine_status supine_csv_open(const char *path, const char *const *names, size_t count,
                              size_t required, supine_csv *csv, supine_error *error);

/* Read a row; *more is false at the end. */
supine_status supine_csv_next(supine_csv *csv, bool *more, supine_error *error);

/* Return the text of an expected column of the last row; NULL if the file lacks the column. */
const char *supine_csv_text(const supine_csv *csv, size_t column);

/* Parse an expected column, which the file has, as a finite number; messages call it `name`. */
supine_status supine_csv_number(const supine_csv *csv, size_t column, const char *name,
                                double *number, supine_error *error);

void supine_csv_close(supine_csv *csv);

#endif
