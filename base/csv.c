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
#include "base/quantity.h"
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

/* Read the next line of the file to csv->text + `used`; set `length` to its length, 0 at the
 * end. */
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

/* Return the characters that are removed from both ends of a record: blanks, and tabs unless they
 * may separate fields, of which the first and the last may be empty. */
static const char *blanks_of(const supine_csv *csv) {
  return csv->separator == '\t' || csv->separator == '\0' ? " \r\n\v\f" : " \t\r\n\v\f";
}

/* Set `text` to the next record, trimmed; NULL at the end. It is a line that is neither blank nor a
 * comment, with the lines after it that its quoted fields contain. */
static supine_status csv_line(supine_csv *csv, char **text, supine_error *error) {
  const char own[] = {csv->separator, '\0'};
  const char *separators = csv->separator != '\0' ? own : ",;\t";
  size_t used = 0;
  const char *first = NULL; /* first character that is not blank */
  do {
    SUPINE_TRY(read_line(csv, 0, &used, error));
    *text = NULL;
    if (used == 0) {
      return SUPINE_OK;
    }
    csv->line = csv->lines_read;
    static const char mark[] = "\xEF\xBB\xBF"; /* byte-order mark of UTF-8 */
    const size_t skip = csv->line == 1 && strncmp(csv->text, mark, 3) == 0 ? 3 : 0;
    *text = csv->text + skip + strspn(csv->text + skip, blanks_of(csv));
    first = *text + strspn(*text, " \t\r\n\v\f");
  } while (*first == '\0' || *first == '#');
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
  *text = csv->text + begin;
  for (size_t end = strlen(*text); end > 0 && strchr(blanks_of(csv), (*text)[end - 1]) != NULL;) {
    (*text)[--end] = '\0';
  }
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

/* Return the separator of a line such as "sep=;" before the header, as Excel writes it; NUL if the
 * line is another one. */
static char stated_separator(const char *line) {
  char separator = '\0';
  if (line != NULL && supine_ascii_same_begin(line, "sep=", 4) && strlen(line) <= 5) {
    separator = line[4] != '\0' ? line[4] : '\t';
  }
  return separator;
}

/* Read the line of the header, and find the separator. */
static supine_status read_header(supine_csv *csv, const char *name, char **text,
                                 supine_error *error) {
  SUPINE_TRY(csv_line(csv, text, error));
  const char stated = stated_separator(*text);
  if (stated != '\0') {
    csv->separator = stated;
    SUPINE_TRY(csv_line(csv, text, error));
  }
  SUPINE_REFUSE_IF(*text == NULL, error, SUPINE_ERROR_FORMAT,
                   "%s: the file is empty; expected a header %s,...", csv->path, name);
  if (stated == '\0') {
    csv->separator = find_separator(*text);
  }
  return SUPINE_OK;
}

/* Find a unit that a column may name, in mm, mL, s or cmH2O. Return false for other names. */
static bool find_unit(const char *name, double *factor) {
  return supine_quantity_find_unit(SUPINE_QUANTITY_LENGTH, name, factor) ||
         supine_quantity_find_unit(SUPINE_QUANTITY_VOLUME, name, factor) ||
         supine_quantity_find_unit(SUPINE_QUANTITY_TIME, name, factor) ||
         supine_quantity_find_unit(SUPINE_QUANTITY_PRESSURE, name, factor);
}

/* Return the length of a column's name without the unit in brackets behind it, such as "x (mm)".
 * Set `unit` to the unit without brackets, "" if there is none. */
static size_t split_unit(const char *field, char unit[16]) {
  const size_t length = strlen(field);
  const char *open = strpbrk(field, "([");
  unit[0] = '\0';
  if (open == NULL || open == field || strchr(")]", field[length - 1]) == NULL) {
    return length;
  }
  (void)snprintf(unit, 16, "%.*s", (int)(field + length - 1 - (open + 1)), open + 1);
  size_t length_of_name = (size_t)(open - field);
  while (length_of_name > 0 && supine_ascii_is_space(field[length_of_name - 1])) {
    length_of_name -= 1;
  }
  return length_of_name;
}

/* Find the expected column of a field of the header, and its unit; `count` if it is none. */
static supine_status find_column(const supine_csv *csv, const char *field, const char *const *names,
                                 size_t count, size_t *column, double *scale, supine_error *error) {
  char unit[16];
  const size_t length = split_unit(field, unit);
  size_t c = 0;
  while (c < count && !supine_ascii_same(field, names[c]) &&
         !(strlen(names[c]) == length && supine_ascii_same_begin(field, names[c], length))) {
    ++c;
  }
  *column = c;
  *scale = 1.0;
  if (c < count && unit[0] != '\0' && !supine_ascii_same(field, names[c])) {
    const bool known = find_unit(unit, scale);
    SUPINE_REFUSE_IF(!known, error, SUPINE_ERROR_FORMAT,
                     "%s:%zu: the unit of column \"%s\" is unknown: give mm, mL, s or cmH2O",
                     csv->path, csv->line, field);
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
    double scale = 1.0;
    SUPINE_TRY(find_column(csv, csv->field[f], names, count, &c, &scale, error));
    SUPINE_REFUSE_IF(c < count && csv->column[c] != SIZE_MAX, error, SUPINE_ERROR_FORMAT,
                     "%s:%zu: repeated column \"%s\" in the header: delete or rename one",
                     csv->path, csv->line, csv->field[f]);
    if (c < count) { /* columns that the caller does not expect are ignored */
      csv->column[c] = f;
      csv->scale[c] = scale;
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

/* Find the order of bytes that a byte-order mark of UTF-16 states: 1 if the lower byte is first, 2
 * if it is second, 0 if there is no mark; -1 for bytes that no text begins with. The file may be a
 * pipe, to which one byte alone can be given back. */
static int order_of(FILE *file) {
  const int first = getc(file);
  if (first != 0xFF && first != 0xFE) {
    (void)ungetc(first, file);
    return 0;
  }
  const int second = getc(file);
  if (first == 0xFF && second == 0xFE) {
    return 1;
  }
  return first == 0xFE && second == 0xFF ? 2 : -1;
}

/* Read the next unit of UTF-16; return false at the end of the file. */
static bool next_unit(FILE *file, int order, unsigned *unit) {
  const int first = getc(file);
  const int second = first == EOF ? EOF : getc(file);
  *unit = order == 1 ? (unsigned)first | (unsigned)second << 8
                     : (unsigned)first << 8 | (unsigned)second;
  return second != EOF;
}

/* Write a character as UTF-8. */
static void put_utf8(FILE *out, unsigned code) {
  static const unsigned begin[] = {0, 0xC0, 0xE0, 0xF0}; /* bits of the first byte */
  const int more = (code >= 0x80 ? 1 : 0) + (code >= 0x800 ? 1 : 0) + (code >= 0x10000 ? 1 : 0);
  (void)putc((int)(begin[more] | code >> 6 * more), out);
  for (int k = more - 1; k >= 0; --k) {
    (void)putc((int)(0x80 | (code >> 6 * k & 0x3F)), out);
  }
}

/* Convert the rest of the file from UTF-16, as Excel writes "Unicode text", to UTF-8 in a file
 * without a name. */
static supine_status decode(supine_csv *csv, int order, supine_error *error) {
  unsigned unit = 0;
  FILE *out = tmpfile();
  SUPINE_REFUSE_IF(out == NULL, error, SUPINE_ERROR_WRITE,
                   "%s: no temporary file for its text, which is UTF-16: save it as UTF-8",
                   csv->path);
  while (next_unit(csv->file, order, &unit)) {
    unsigned low = 0;
    const bool pair = unit >= 0xD800 && unit < 0xDC00 && next_unit(csv->file, order, &low);
    put_utf8(out, pair ? 0x10000 + ((unit & 0x3FF) << 10) + (low & 0x3FF) : unit);
  }
  (void)fclose(csv->file);
  csv->file = out;
  const bool written = fflush(out) == 0 && fseek(out, 0, SEEK_SET) == 0;
  SUPINE_REFUSE_IF(!written, error, SUPINE_ERROR_WRITE,
                   "%s: the temporary file for its text cannot be written", csv->path);
  return SUPINE_OK;
}

static supine_status csv_open(const char *path, supine_csv *csv, supine_error *error) {
  *csv = (supine_csv){.path = path};
  csv->file = fopen(path, "rb");
  SUPINE_REFUSE_IF(csv->file == NULL, error, SUPINE_ERROR_READ, "%s: cannot open: %s", path,
                   strerror(errno));
  const int order = order_of(csv->file);
  supine_status status = SUPINE_OK;
  if (order < 0) {
    status = supine_error_set(error, SUPINE_ERROR_FORMAT,
                              "%s: is no text in UTF-8 or UTF-16: save it as CSV", path);
  } else if (order > 0) {
    status = decode(csv, order, error);
  }
  if (status != SUPINE_OK) {
    supine_csv_close(csv);
  }
  return status;
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

double supine_csv_scale(const supine_csv *csv, size_t column) {
  return csv->column[column] != SIZE_MAX ? csv->scale[column] : 1.0;
}

/* Return whether all fields of the row are empty, as in rows that a spreadsheet keeps. */
static bool is_empty(const supine_csv *csv) {
  bool empty = csv->field_count > 1;
  for (size_t f = 0; f < csv->field_count; ++f) {
    empty = empty && csv->field[f][0] == '\0';
  }
  return empty;
}

supine_status supine_csv_next(supine_csv *csv, bool *more, supine_error *error) {
  char *text = NULL;
  do {
    SUPINE_TRY(csv_line(csv, &text, error));
    *more = text != NULL;
    if (text == NULL) {
      return SUPINE_OK;
    }
    SUPINE_TRY(csv_split(csv, text, error));
  } while (is_empty(csv));
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
  char *comma = strchr(text, ','); /* a field that has one was not split there */
  if (comma != NULL) {
    *comma = '.';
  }
  *number = supine_number_parse(text, &end);
  SUPINE_REFUSE_IF(end == text || *end != '\0' || !isfinite(*number), error, SUPINE_ERROR_FORMAT,
                   "%s:%zu: %s \"%s\" is not a finite number: give a number", csv->path, csv->line,
                   name, text);
  *number *= csv->scale[column];
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
