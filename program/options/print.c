/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Print a JSON value as JSON, or as text with a line per member and tables. */
#include <math.h>
#include <string.h>

#include <jansson.h>

#include "sh/base/text.h"

#include "program/options/command.h"

enum { TEXT_MAX = 4096, COLUMNS_MAX = 16, NAME_WIDTH = 22 };

/* Write a value, or a list of values, on one line. */
static void write_text(const json_t *value, char text[TEXT_MAX]) {
  size_t i;
  const json_t *item;
  text[0] = '\0';
  switch (json_typeof(value)) {
  case JSON_ARRAY:
    json_array_foreach(value, i, item) {
      char one[TEXT_MAX];
      write_text(item, one);
      supine_text_add(text, TEXT_MAX, "%s%s", i > 0 ? ", " : "", one);
    }
    break;
  case JSON_STRING:
    supine_text_add(text, TEXT_MAX, "%s", json_string_value(value));
    break;
  case JSON_INTEGER:
    supine_text_add(text, TEXT_MAX, "%" JSON_INTEGER_FORMAT, json_integer_value(value));
    break;
  case JSON_REAL:
    supine_text_add(text, TEXT_MAX, fabs(json_real_value(value)) < 1000.0 ? "%.4g" : "%.1f",
                    json_real_value(value));
    break;
  default:
    supine_text_add(text, TEXT_MAX, "%s",
                    json_is_true(value)    ? "yes"
                    : json_is_false(value) ? "no"
                                           : "-");
  }
}

/* Return whether a value is an object or a list of objects. */
static bool has_objects(const json_t *value) {
  return json_is_object(value) || json_is_object(json_array_get(value, 0));
}

/* Return whether every member of an object fits on one line. */
static bool is_row(json_t *object) {
  const char *name;
  json_t *member;
  json_object_foreach(object, name, member) {
    if (has_objects(member)) {
      return false;
    }
  }
  return json_is_object(object);
}

/* Write a name with spaces instead of underscores. */
static void write_name(const char *name, char text[TEXT_MAX]) {
  (void)snprintf(text, TEXT_MAX, "%s", name);
  for (char *at = text; (at = strchr(at, '_')) != NULL;) {
    *at = ' ';
  }
}

/* Print rows of equal members as a table with a heading. */
static void print_table(const json_t *rows) {
  json_t *first = json_array_get(rows, 0);
  size_t width[COLUMNS_MAX] = {0};
  char text[TEXT_MAX];
  for (int pass = 0; pass < 2; ++pass) { /* measure, then print */
    for (size_t i = 0; i <= json_array_size(rows); ++i) {
      const char *name;
      json_t *member;
      size_t column = 0;
      json_object_foreach(first, name, member) {
        if (i == 0) {
          write_name(name, text);
        } else {
          write_text(json_object_get(json_array_get(rows, i - 1), name), text);
        }
        const size_t length = strlen(text);
        if (pass == 0) {
          width[column] = length > width[column] ? length : width[column];
        } else {
          const bool last = column + 1 == json_object_size(first);
          const int side = json_is_number(member) ? 1 : last ? 0 : -1; /* numbers to the right */
          (void)printf("  %*s", side * (int)width[column], text);
        }
        column += column + 1 < COLUMNS_MAX;
      }
      (void)fputs(pass == 0 ? "" : "\n", stdout);
    }
  }
}

static void print_object(json_t *object, int indent);

/* Print a member: one line, a table where its rows are alike, else each of its objects. */
static void print_member(const char *name, json_t *value, int indent) {
  char text[TEXT_MAX];
  char heading[TEXT_MAX];
  size_t i;
  json_t *item;
  write_name(name, heading);
  if (json_is_array(value) && json_is_string(json_array_get(value, 0))) {
    json_array_foreach(value, i, item) {
      print_member(name, item, indent);
    }
  } else if (!has_objects(value)) {
    write_text(value, text);
    if (text[0] != '\0') {
      (void)printf("%*s%-*s %s\n", indent, "", NAME_WIDTH - indent, heading, text);
    }
  } else if (is_row(json_array_get(value, 0))) {
    (void)printf("%*s%s\n", indent, "", heading);
    print_table(value);
  } else if (json_is_array(value)) {
    json_array_foreach(value, i, item) {
      (void)printf("%s %zu\n", heading, i + 1);
      print_object(item, indent + 2);
    }
  } else {
    (void)printf("%*s%s\n", indent, "", heading);
    print_object(value, indent + 2);
  }
}

/* Print the members of an object; members that are all rows, as a table with their names. */
static void print_object(json_t *object, int indent) {
  const char *name;
  json_t *member;
  json_t *rows = json_array();
  json_object_foreach(object, name, member) {
    if (is_row(member)) {
      json_t *row = json_pack("{s:s}", "", name);
      (void)json_object_update(row, member);
      (void)json_array_append_new(rows, row);
    }
  }
  if (json_array_size(rows) > 1 && json_array_size(rows) == json_object_size(object)) {
    print_table(rows);
  } else {
    json_object_foreach(object, name, member) {
      print_member(name, member, indent);
    }
  }
  json_decref(rows);
}

void supine_options_print(json_t *value, bool json) {
  if (json) {
    (void)json_dumpf(value, stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(9));
    (void)putchar('\n');
  } else if (json_is_array(value)) {
    print_table(value);
  } else {
    print_object(value, 0);
  }
  json_decref(value);
}
