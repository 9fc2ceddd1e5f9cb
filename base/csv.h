/* SPDX-License-Identifier: MIT */
/* Read small CSV files, and write them (RFC 4180). */
#ifndef SUPINE_CSV_H
#define SUPINE_CSV_H

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

#include <supine/status.h>

enum { SUPINE_CSV_FIELDS_MAX = 64 };

/* A CSV file being read. It has a header, and may have comments (#), rows without text and quoted
 * fields, which may contain separators and line ends. It must be UTF-8, or UTF-16 with a byte-order
 * mark. The separator of the header, ',', ';' or tab, holds for all lines: the most frequent one,
 * or that of a line "sep=;" before the header, as Excel writes it. Numbers may have a decimal comma
 * where it does not separate fields. A column may name its unit behind its name, such as "x (cm)":
 * numbers are then converted to mm, mL, s or cmH2O. Zero-initialise. */
typedef struct supine_csv {
  const char *path;
  FILE *file;
  char *text;       /* current row, with all its lines */
  size_t text_size; /* allocated, bytes */
  char *next;       /* line read last */
  size_t next_size; /* allocated, bytes */
  size_t lines_read;
  size_t line; /* number of the first line of the current row, from 1 */
  char separator;
  bool may_have_more; /* rows may have more fields than the header */
  size_t field_count;
  char *field[SUPINE_CSV_FIELDS_MAX];   /* fields of the current row */
  size_t column_count;                  /* number of fields of the header */
  size_t column[SUPINE_CSV_FIELDS_MAX]; /* index of each expected column; SIZE_MAX if absent */
  double scale[SUPINE_CSV_FIELDS_MAX];  /* unit of each expected column; 1 if it names none */
} supine_csv;

/* Open a file and read its header. `names` are the `count` columns that the caller expects. The
 * file must have the first `required` of them, in any order, in upper or lower case. Columns that
 * are not in `names` are ignored.
 * @param path  must outlive the reader */
supine_status supine_csv_open(const char *path, const char *const *names, size_t count,
                              size_t required, supine_csv *csv, supine_error *error);

/* As supine_csv_open for a file without a header, whose columns are those of `header`. Rows may
 * have further fields. */
supine_status supine_csv_open_bare(const char *path, const char *header, const char *const *names,
                                   size_t count, size_t required, supine_csv *csv,
                                   supine_error *error);

/* Return whether the file has a column, an index into the `names` of supine_csv_open. */
bool supine_csv_has(const supine_csv *csv, size_t column);

/* Return the factor by which the numbers of a column are converted: the unit that the header names
 * in mm, mL, s or cmH2O; 1 if it names none. */
double supine_csv_scale(const supine_csv *csv, size_t column);

/* Read the next row; set *more to false at the end. */
supine_status supine_csv_next(supine_csv *csv, bool *more, supine_error *error);

/* Return the text of a column in the current row, or NULL if the file lacks the column. `column` is
 * an index into the `names` of supine_csv_open. */
const char *supine_csv_text(const supine_csv *csv, size_t column);

/* Parse the number of a column in the current row. `column` is an index into the `names` of
 * supine_csv_open. The file must have the column.
 * @param name    name of the column in messages
 * @param number  finite number, written */
supine_status supine_csv_number(const supine_csv *csv, size_t column, const char *name,
                                double *number, supine_error *error);

void supine_csv_close(supine_csv *csv);

/* A row being written: {.file = FILE}. ferror tells whether writing failed. Lines end in LF. */
typedef struct supine_csv_row {
  FILE *file;
  bool begun; /* whether the row has a field */
} supine_csv_row;

/* Add a field of any text, and quote it if a reader would otherwise change it. */
void supine_csv_add_text(supine_csv_row *row, const char *text);

/* Add a number, or several separated by commas, printed like supine_print. */
SUPINE_PRINTF(2, 3) void supine_csv_add(supine_csv_row *row, const char *format, ...);

/* End the row; the next field begins another. */
void supine_csv_end_row(supine_csv_row *row);

#endif
