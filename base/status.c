/* SPDX-License-Identifier: MIT */
/* Describe status codes in words, and set the detail of an error. */
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#include <supine/status.h>

#include "base/ascii.h"
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
    memset(error->remedies, 0, sizeof error->remedies);
    supine_utf8_escape(message, "", error->message, sizeof error->message);
  }
  return status;
}

void supine_error_advise(supine_error *error, const supine_remedy remedies[SUPINE_REMEDIES_MAX]) {
  if (error != NULL) {
    memcpy(error->remedies, remedies, sizeof error->remedies);
  }
}

/* How a host writes arguments. */
static const struct {
  const char *before, *between, *quote; /* the quotes are around texts, not around numbers */
  const char *set;                      /* value of an argument that is true or false */
} spelling[] = {[SUPINE_WORDS_COMMAND] = {"--", " ", "", ""},
                [SUPINE_WORDS_PYTHON] = {"", "=", "'", "True"},
                [SUPINE_WORDS_JAVASCRIPT] = {"", ": ", "'", "true"}};

/* Write the name of an argument, which has underscores between its words, as a host does. */
static void write_name(const char *argument, supine_words words, char *text, size_t size) {
  size_t length = (size_t)snprintf(text, size, "%s", spelling[words].before);
  for (const char *c = argument; *c != '\0' && length + 1 < size; ++c) {
    char letter = *c;
    if (letter == '_' && words == SUPINE_WORDS_JAVASCRIPT && c[1] != '\0') {
      letter = supine_ascii_upper(*++c);
    } else if (letter == '_' && words == SUPINE_WORDS_COMMAND) {
      letter = '-';
    }
    text[length++] = letter;
  }
  text[length] = '\0';
}

/* Write an argument, and its value unless that is "". */
static void write_argument(const supine_remedy *remedy, supine_words words, char *text,
                           size_t size) {
  char name[64];
  const bool set = remedy->kind == SUPINE_REMEDY_SET;
  const char *value = set ? spelling[words].set : remedy->value;
  write_name(remedy->argument, words, name, sizeof name);
  if (remedy->kind == SUPINE_REMEDY_SUCH_AS || value[0] == '\0') {
    (void)snprintf(text, size, "%s", name);
  } else {
    const bool is_number = strspn(value, "-.0123456789") == strlen(value);
    const char *quote = set || is_number ? "" : spelling[words].quote;
    (void)snprintf(text, size, "%s%s%s%s%s", name, spelling[words].between, quote, value, quote);
  }
}

/* Write one remedy, such as "give --axes LPS" or "leave --clamp out". */
static void write_remedy(const supine_remedy *remedy, supine_words words, char *text, size_t size) {
  char argument[128];
  char example[SUPINE_REMEDY_VALUE_MAX + 16] = "";
  const char *way = "give ";
  const char *end = "";
  write_argument(remedy, words, argument, sizeof argument);
  if (remedy->kind == SUPINE_REMEDY_SUCH_AS) {
    (void)snprintf(example, sizeof example, ", such as %s%s", remedy->value,
                   remedy->when[0] != '\0' ? "," : "");
  } else if (remedy->kind == SUPINE_REMEDY_CHANGE) {
    way = "change ";
  } else if (remedy->kind == SUPINE_REMEDY_OMIT) {
    way = "leave ";
    end = " out";
  }
  (void)snprintf(text, size, "%s%s%s%s%s%s", way, argument, example, end,
                 remedy->when[0] != '\0' ? " " : "", remedy->when);
}

void supine_remedies_add(const supine_remedy remedies[SUPINE_REMEDIES_MAX], supine_words words,
                         char *text, size_t size) {
  for (size_t i = 0; i < SUPINE_REMEDIES_MAX; ++i) {
    char one[256];
    if (remedies[i].kind == SUPINE_REMEDY_NONE) {
      return;
    }
    const size_t length = strlen(text);
    const char last = length > 0 ? text[length - 1] : ';';
    write_remedy(&remedies[i], words, one, sizeof one);
    const char *join = i > 0 ? ", or " : "; ";
    if (i == 0 && (last == '.' || last == '?')) { /* a new sentence */
      join = " ";
      one[0] = supine_ascii_upper(one[0]);
    }
    (void)snprintf(text + length, size - length, "%s%s", join, one);
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
  supine_error_advise(error, cause->remedies);
  return cause->status;
}
