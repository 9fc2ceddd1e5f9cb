/* SPDX-License-Identifier: MIT */
/* Read small CSV files, and write them. */
#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"
#include "base/ascii.h"
#include "base/csv.h"
#include "base/number.h"
#include "base/text.h"

static char *trim(char *text) {
  while (supine_ascii_is_space(*text)) {
    ++text;
  }
  size_t length = strlen(text);
  while (length > 0 && supine_ascii_is_space(text[length - 1])) {
    text[--length] = '\0';
  }
  return text;
}

/* Read the next line of the file to csv->text + `used`; set `length` to its length, 0 at the end.
 */
static supine_status read_line(supine_csv *csv, size_t used, size_t *length, supine_error *error) {
  errno = 0;
  const ssize_t count = getline(&csv->next, &csv->next_size, csv->file);
  *length = count > 0 ? (size_t)count : 0;
  SUPINE_REFUSE_IF(count < 0 && ferror(csv->file) != 0, error, SUPINE_ERROR_READ,
                   "%s: cannot read: %s", csv->path, strerror(errno));
  if (count < 0 && errno == ENOMEM) {
    return supine_error_memory(error, "a line of %s", csv->path);
  }
  if (used + *length + 1 > csv->text_size) {
    const size_t size = 2 * (used + *length + 1);
    char *more = realloc(csv->text, size);
    if (more == NULL) {
      return supine_error_memory(error, "a line of %s", csv->path);
    }
    csv->text = more;
    csv->text_size = size;
  }
  memcpy(csv->text + used, csv->next, *length);
  csv->text[used + *length] = '\0';
  csv->lines_read += *length > 0 ? 1 : 0;
  SUPINE_REFUSE_IF(strlen(csv->text + used) != *length, error, SUPINE_ERROR_FORMAT,
                   "%s:%zu: a NUL byte: save the file as CSV text", csv->path, csv->lines_read);
  return SUPINE_OK;
}

/* Return whether a quoted field is open at the end of a line, given whether one is open at its
 * begin. In the header, before the separator is known, `separators` are all that are possible. */
static bool is_open_after(const char *line, const char *separators, bool open) {
  for (const char *at = line; *at != '\0';) {
    if (!open) {
      at += strspn(at, " ");
      open = *at == '"';
      at += open ? 1 : 0;
    }
    while (open && *at != '\0') {
      open = *at != '"' || at[1] == '"';
      at += open && *at == '"' ? 2 : 1;
    }
    if (!open) {
      at += strcspn(at, separators);
      at += *at != '\0' ? 1 : 0;
    }
  }
  return open;
}

/* Set `text` to the next record, trimmed; NULL at the end. It is a line that is neither blank nor a
 * comment, with the lines after it that its quoted fields contain. */
static supine_status csv_line(supine_csv *csv, char **text, supine_error *error) {
  const char own[] = {csv->separator, '\0'};
  const char *separators = csv->separator != '\0' ? own : ",;\t";
  size_t used = 0;
  do {
    SUPINE_TRY(read_line(csv, 0, &used, error));
    *text = NULL;
    if (used == 0) {
      return SUPINE_OK;
    }
    csv->line = csv->lines_read;
    static const char mark[] = "\xEF\xBB\xBF"; /* byte-order mark of UTF-8 */
    const size_t skip = csv->line == 1 && strncmp(csv->text, mark, 3) == 0 ? 3 : 0;
    *text = csv->text + skip + strspn(csv->text + skip, " \t\r\n\v\f");
  } while (**text == '\0' || **text == '#');
  const size_t begin = (size_t)(*text - csv->text);
  size_t length = used;
  bool open = is_open_after(*text, separators, false);
  while (open) {
    SUPINE_TRY(read_line(csv, used, &length, error));
    SUPINE_REFUSE_IF(length == 0, error, SUPINE_ERROR_FORMAT,
                     "%s:%zu: a quote is not closed: add \"", csv->path, csv->line);
    open = is_open_after(csv->text + used, separators, true);
    used += length;
  }
  *text = trim(csv->text + begin);
  SUPINE_REFUSE_IF(!supine_text_is_utf8(*text), error, SUPINE_ERROR_FORMAT,
                   "%s:%zu: the text is not UTF-8: save the file with the encoding UTF-8",
                   csv->path, csv->line);
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
  end += strspn(end, " ");
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

/* Return the separator of a header: the most frequent one outside quotes. */
static char find_separator(const char *text) {
  static const char separators[] = ",;\t";
  size_t count[3] = {0};
  bool quoted = false;
  for (const char *at = text; *at != '\0'; ++at) {
    quoted = quoted != (*at == '"');
    if (!quoted) {
      for (size_t i = 0; i < 3; ++i) {
        count[i] += *at == separators[i] ? 1 : 0;
      }
    }
  }
  size_t best = 0;
  for (size_t i = 1; i < 3; ++i) {
    best = count[i] > count[best] ? i : best;
  }
  return separators[best];
}

/* Read the line of the header, and find the separator. */
static supine_status read_header(supine_csv *csv, const char *name, char **text,
                                 supine_error *error) {
  SUPINE_TRY(csv_line(csv, text, error));
  const bool stated = *text != NULL && strncmp(*text, "sep=", 4) == 0 && strlen(*text) == 5;
  if (stated) { /* of Excel */
    csv->separator = (*text)[4];
    SUPINE_TRY(csv_line(csv, text, error));
  }
  SUPINE_REFUSE_IF(*text == NULL, error, SUPINE_ERROR_FORMAT,
                   "%s: the file is empty; expected a header %s,...", csv->path, name);
  if (!stated) {
    csv->separator = find_separator(*text);
  }
  return SUPINE_OK;
}

/* Find the columns that the caller expects in the text of a header. */
static supine_status find_columns(supine_csv *csv, char *text, const char *const *names,
                                  size_t count, size_t required, supine_error *error) {
  SUPINE_TRY(csv_split(csv, text, error));
  for (size_t c = 0; c < SUPINE_CSV_FIELDS_MAX; ++c) {
    csv->column[c] = SIZE_MAX;
  }
  for (size_t f = 0; f < csv->field_count; ++f) {
    size_t c = 0;
    while (c < count && !supine_ascii_same(csv->field[f], names[c])) {
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

static supine_status csv_open(const char *path, supine_csv *csv, supine_error *error) {
  *csv = (supine_csv){.path = path};
  csv->file = fopen(path, "rb");
  SUPINE_REFUSE_IF(csv->file == NULL, error, SUPINE_ERROR_READ, "%s: cannot open: %s", path,
                   strerror(errno));
  return SUPINE_OK;
}

supine_status supine_csv_open(const char *path, const char *const *names, size_t count,
                              size_t required, supine_csv *csv, supine_error *error) {
  char *text = NULL;
  SUPINE_TRY(csv_open(path, csv, error));
  supine_status status = read_header(csv, names[0], &text, error);
  if (status == SUPINE_OK) {
    status = find_columns(csv, text, names, count, required, error);
  }
  if (status != SUPINE_OK) {
    supine_csv_close(csv);
  }
  return status;
}

supine_status supine_csv_open_bare(const char *path, const char *header, const char *const *names,
                                   size_t count, size_t required, supine_csv *csv,
                                   supine_error *error) {
  char text[512];
  SUPINE_TRY(csv_open(path, csv, error));
  csv->separator = ',';
  csv->may_have_more = true;
  (void)snprintf(text, sizeof text, "%s", header);
  const supine_status status = find_columns(csv, text, names, count, required, error);
  if (status != SUPINE_OK) {
    supine_csv_close(csv);
  }
  return status;
}

bool supine_csv_has(const supine_csv *csv, size_t column) {
  return csv->column[column] != SIZE_MAX;
}

supine_status supine_csv_next(supine_csv *csv, bool *more, supine_error *error) {
  char *text = NULL;
  SUPINE_TRY(csv_line(csv, &text, error));
  *more = text != NULL;
  if (text == NULL) {
    return SUPINE_OK;
  }
  SUPINE_TRY(csv_split(csv, text, error));
  const bool more_allowed = csv->may_have_more && csv->field_count > csv->column_count;
  SUPINE_REFUSE_IF(
      csv->field_count != csv->column_count && !more_allowed, error, SUPINE_ERROR_FORMAT,
      "%s:%zu: %zu field%s, but the header has %zu: add or delete fields", csv->path, csv->line,
      csv->field_count, csv->field_count == 1 ? "" : "s", csv->column_count);
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
  *number = supine_number_parse(text, &end);
  SUPINE_REFUSE_IF(end == text || *end != '\0' || !isfinite(*number), error, SUPINE_ERROR_FORMAT,
                   "%s:%zu: %s \"%s\" is not a finite number: give a number", csv->path, csv->line,
                   name, text);
  return SUPINE_OK;
}

void supine_csv_close(supine_csv *csv) {
  supine_file_close(&csv->file);
  free(csv->text);
  free(csv->next);
  *csv = (supine_csv){0};
}

/* Return whether a reader would not find `text` as it is: it splits at separators and lines, takes
 * off blanks, and skips lines that begin with '#'. */
static bool needs_quotes(const char *text) {
  const size_t length = strlen(text);
  return strpbrk(text, ",;\t\"\r\n") != NULL || *text == '#' ||
         (length > 0 && (supine_ascii_is_space(*text) || supine_ascii_is_space(text[length - 1])));
}

static void begin_field(supine_csv_row *row) {
  if (row->begun) {
    (void)putc(',', row->file);
  }
  row->begun = true;
}

void supine_csv_add_text(supine_csv_row *row, const char *text) {
  begin_field(row);
  if (!needs_quotes(text)) {
    (void)fputs(text, row->file);
    return;
  }
  (void)putc('"', row->file);
  for (const char *at = text; *at != '\0'; ++at) {
    if (*at == '"') {
      (void)putc('"', row->file);
    }
    (void)putc(*at, row->file);
  }
  (void)putc('"', row->file);
}

void supine_csv_add(supine_csv_row *row, const char *format, ...) {
  va_list arguments;
  begin_field(row);
  va_start(arguments, format);
  (void)supine_print_list(row->file, format, arguments);
  va_end(arguments);
}

void supine_csv_end_row(supine_csv_row *row) {
  (void)putc('\n', row->file);
  row->begun = false;
}
