/* SPDX-License-Identifier: MIT */
/* Read small CSV files. */
#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/arena.h"
#include "base/csv.h"

static char *trim(char *text) {
  while (isspace((unsigned char)*text)) {
    ++text;
  }
  size_t length = strlen(text);
  while (length > 0 && isspace((unsigned char)text[length - 1])) {
    text[--length] = '\0';
  }
  return text;
}

/* Set `text` to the next line that is neither blank nor a comment, trimmed; NULL at the end. */
static supine_status csv_line(supine_csv *csv, char **text, supine_error *error) {
  do {
    errno = 0;
    const ssize_t length = getline(&csv->text, &csv->capacity, csv->file);
    *text = NULL;
    if (length < 0) {
      return errno == ENOMEM ? supine_error_memory(error, "a line of %s", csv->path)
             : ferror(csv->file) != 0
                 ? supine_error_set(error, SUPINE_ERROR_READ, "%s: cannot read: %s", csv->path,
                                    strerror(errno))
                 : SUPINE_OK;
    }
    ++csv->line;
    SUPINE_REFUSE_IF(strlen(csv->text) != (size_t)length, error, SUPINE_ERROR_FORMAT,
                     "%s:%zu: a NUL byte: save the file as CSV text", csv->path, csv->line);
    static const char mark[] = "\xEF\xBB\xBF"; /* byte-order mark of UTF-8 */
    const size_t skip = csv->line == 1 && strncmp(csv->text, mark, 3) == 0 ? 3 : 0;
    *text = trim(csv->text + skip);
  } while (**text == '\0' || **text == '#');
  return SUPINE_OK;
}

/* Return the field at *rest, ended by a NUL. Move *rest to the next field, or set it to NULL after
 * the last field. A quoted field may contain the separator, and "" in it is one quote. Return NULL
 * if a quote is not closed. */
static char *csv_field(char **rest, char separator) {
  char *field = *rest + strspn(*rest, " ");
  char *end = field;
  if (*field != '"') {
    end = strchr(field, separator);
    *rest = end != NULL ? end + 1 : NULL;
    if (end != NULL) {
      *end = '\0';
    }
    return trim(field);
  }
  char *to = field++;
  char *begin = to;
  for (end = field; *end != '"' || end[1] == '"'; ++end) {
    if (*end == '\0') {
      return NULL;
    }
    end += *end == '"';
    *to++ = *end;
  }
  *to = '\0';
  ++end;
  end += strspn(end, " \t");
  if (*end != separator && *end != '\0') {
    return NULL;
  }
  *rest = *end == separator ? end + 1 : NULL;
  return begin;
}

static supine_status csv_split(supine_csv *csv, char *text, supine_error *error) {
  csv->field_count = 0;
  for (char *rest = text; rest != NULL;) {
    SUPINE_REFUSE_IF(csv->field_count == SUPINE_CSV_FIELDS_MAX, error, SUPINE_ERROR_FORMAT,
                     "%s:%zu: more than %d fields: delete columns", csv->path, csv->line,
                     (int)SUPINE_CSV_FIELDS_MAX);
    char *field = csv_field(&rest, csv->separator);
    SUPINE_REFUSE_IF(field == NULL, error, SUPINE_ERROR_FORMAT,
                     "%s:%zu: a quote is not closed: add \"", csv->path, csv->line);
    csv->field[csv->field_count++] = field;
  }
  return SUPINE_OK;
}

static supine_status csv_header(supine_csv *csv, const char *const *names, size_t count,
                                size_t required, supine_error *error) {
  char *text = NULL;
  SUPINE_TRY(csv_line(csv, &text, error));
  SUPINE_REFUSE_IF(text == NULL, error, SUPINE_ERROR_FORMAT,
                   "%s: the file is empty; expected a header %s,...", csv->path, names[0]);
  csv->separator = strchr(text, ',') != NULL    ? ','
                   : strchr(text, ';') != NULL  ? ';'
                   : strchr(text, '\t') != NULL ? '\t'
                                                : ',';
  SUPINE_TRY(csv_split(csv, text, error));
  for (size_t c = 0; c < SUPINE_CSV_FIELDS_MAX; ++c) {
    csv->column[c] = SIZE_MAX;
  }
  for (size_t f = 0; f < csv->field_count; ++f) {
    size_t c = 0;
    while (c < count && strcasecmp(csv->field[f], names[c]) != 0) {
      ++c;
    }
    SUPINE_REFUSE_IF(c < count && csv->column[c] != SIZE_MAX, error, SUPINE_ERROR_FORMAT,
                     "%s:%zu: repeated column \"%s\" in the header: delete or rename one",
                     csv->path, csv->line, csv->field[f]);
    if (c < count) { /* columns that the caller does not expect are ignored */
      csv->column[c] = f;
    }
  }
  for (size_t c = 0; c < required; ++c) {
    SUPINE_REFUSE_IF(csv->column[c] == SIZE_MAX, error, SUPINE_ERROR_FORMAT,
                     "%s:%zu: the header has no column \"%s\"; expected %s,%s,...", csv->path,
                     csv->line, names[c], names[0], names[1]);
  }
  csv->column_count = csv->field_count;
  return SUPINE_OK;
}

supine_status supine_csv_open(const char *path, const char *const *names, size_t count,
                              size_t required, supine_csv *csv, supine_error *error) {
  *csv = (supine_csv){.path = path};
  csv->file = fopen(path, "rb");
  SUPINE_REFUSE_IF(csv->file == NULL, error, SUPINE_ERROR_READ, "%s: cannot open: %s", path,
                   strerror(errno));
  const supine_status status = csv_header(csv, names, count, required, error);
  if (status != SUPINE_OK) {
    supine_csv_close(csv);
  }
  return status;
}

supine_status supine_csv_next(supine_csv *csv, bool *more, supine_error *error) {
  char *text = NULL;
  SUPINE_TRY(csv_line(csv, &text, error));
  *more = text != NULL;
  if (text == NULL) {
    return SUPINE_OK;
  }
  SUPINE_TRY(csv_split(csv, text, error));
  SUPINE_REFUSE_IF(csv->field_count != csv->column_count, error, SUPINE_ERROR_FORMAT,
                   "%s:%zu: %zu field%s, but the header has %zu: add or delete fields", csv->path,
                   csv->line, csv->field_count, csv->field_count == 1 ? "" : "s",
                   csv->column_count);
  return SUPINE_OK;
}

const char *supine_csv_text(const supine_csv *csv, size_t column) {
  return csv->column[column] == SIZE_MAX ? NULL : csv->field[csv->column[column]];
}

supine_status supine_csv_number(const supine_csv *csv, size_t column, const char *name,
                                double *number, supine_error *error) {
  char *text = csv->field[csv->column[column]];
  char *end = NULL;
  char *comma = csv->separator == ';' ? strchr(text, ',') : NULL;
  if (comma != NULL) { /* with ';' between fields, a comma is a decimal comma */
    *comma = '.';
  }
  *number = strtod(text, &end);
  SUPINE_REFUSE_IF(end == text || *end != '\0' || !isfinite(*number), error, SUPINE_ERROR_FORMAT,
                   "%s:%zu: %s \"%s\" is not a finite number: give a number", csv->path, csv->line,
                   name, text);
  return SUPINE_OK;
}

void supine_csv_close(supine_csv *csv) {
  supine_file_close(&csv->file);
  free(csv->text);
  *csv = (supine_csv){0};
}
