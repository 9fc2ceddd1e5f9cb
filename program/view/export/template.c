/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "program/view/export/template.h"
#include "base/locale.h"

#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

/* Return the asset whose name is the first `length` bytes of `name`, or NULL. */
static const supine_asset *find_asset(const supine_asset *assets, const char *name, size_t length) {
  for (const supine_asset *a = assets; a->name != NULL; ++a) {
    if (strlen(a->name) == length && memcmp(a->name, name, length) == 0) {
      return a;
    }
  }
  return NULL;
}

/* A value and its enclosing scope. A name is looked up in the members of the value first, then in
 * the enclosing scope. */
typedef struct scope {
  const json_t *value;
  const struct scope *outer;
} scope;

/* A tag of a template: {{...}}. */
typedef struct tag {
  char kind; /* '#' begins a section, '/' ends one, 0 is a value */
  const char *name;
  size_t length;
  const char *begin, *end; /* the tag with its braces; NULL if there is no further tag */
} tag;

static tag next_tag(const char *at, const char *end) {
  tag found = {0};
  const char *open = strstr(at, "{{"); /* a NUL follows every asset */
  const char *close = open == NULL ? NULL : strstr(open, "}}");
  if (close != NULL && close + 2 <= end) {
    found.begin = open;
    found.end = close + 2;
    found.name = open + 2;
    if (memchr("#/", *found.name, 2) != NULL) {
      found.kind = *found.name++;
      found.end += found.end < end && *found.end == '\n';
    }
    found.length = (size_t)(close - found.name);
  }
  return found;
}

static const json_t *look_up(const scope *from, const char *name, size_t length) {
  if (length == 1 && *name == '.') {
    return from->value;
  }
  const json_t *found = NULL;
  for (; from != NULL && found == NULL; from = from->outer) {
    found = json_object_getn(from->value, name, length);
  }
  return found;
}

/* Write text with HTML's reserved characters & < > " replaced by entities. */
static void escape(const char *text, FILE *file) {
  static const char reserved[] = "&<>\"";
  static const char *const entities[] = {"&amp;", "&lt;", "&gt;", "&quot;"};
  for (;;) {
    const size_t plain = strcspn(text, reserved);
    (void)fwrite(text, 1, plain, file);
    if (text[plain] == '\0') {
      return;
    }
    (void)fputs(entities[strchr(reserved, text[plain]) - reserved], file);
    text += plain + 1;
  }
}

static void write_value(const json_t *value, FILE *file) {
  SUPINE_C_LOCALE;
  if (json_is_string(value)) {
    escape(json_string_value(value), file);
  } else if (json_is_integer(value)) {
    (void)fprintf(file, "%" JSON_INTEGER_FORMAT, json_integer_value(value));
  } else {
    (void)json_dumpf(value, file, JSON_ENCODE_ANY | JSON_REAL_PRECISION(9));
  }
}

static const char *fill(const supine_asset *assets, const char *at, const char *end,
                        const scope *around, FILE *file);

static void write_named(const supine_asset *assets, const tag *named, const scope *around,
                        FILE *file) {
  const json_t *value = look_up(around, named->name, named->length);
  const supine_asset *asset = find_asset(assets, named->name, named->length);
  if (value != NULL) {
    write_value(value, file);
  } else if (asset != NULL && strstr(asset->name, ".html") != NULL) {
    /* Omit the last newline of the asset, because the template has a newline after the tag. */
    const size_t size = asset->size - (asset->bytes[asset->size - 1] == '\n');
    (void)fill(assets, asset->bytes, asset->bytes + size, around, file);
  } else if (asset != NULL) {
    (void)fwrite(asset->bytes, 1, asset->size, file);
  }
}

/* Write a section for each of its values. Return the position after the tag that ends it. */
static const char *fill_section(const supine_asset *assets, const tag *open, const char *end,
                                const scope *around, FILE *file) {
  const json_t *value = look_up(around, open->name, open->length);
  const bool once = json_is_object(value) || json_is_string(value) || json_is_number(value) ||
                    json_is_true(value);
  const size_t count = once ? 1 : json_array_size(value);
  scope inner = {value, around};
  if (file != NULL) {
    for (size_t i = 0; i < count; ++i) {
      inner.value = once ? value : json_array_get(value, i);
      (void)fill(assets, open->end, end, &inner, file);
    }
  }
  return fill(assets, open->end, end, &inner, NULL);
}

/* Write a template up to the tag that ends the enclosing section, or to `end`, and return the
 * position after that. If `file` is NULL, write nothing. */
static const char *fill(const supine_asset *assets, const char *at, const char *end,
                        const scope *around, FILE *file) {
  for (;;) {
    const tag found = next_tag(at, end);
    if (file != NULL) {
      (void)fwrite(at, 1, (size_t)((found.end != NULL ? found.begin : end) - at), file);
    }
    if (found.end == NULL || (found.kind == '/' && around->outer != NULL)) {
      return found.end != NULL ? found.end : end;
    }
    at = found.end;
    if (found.kind == '#') {
      at = fill_section(assets, &found, end, around, file);
    } else if (file != NULL && found.kind == 0) {
      write_named(assets, &found, around, file);
    }
  }
}

void supine_export_template_fill(const supine_asset *assets, const json_t *data, const char *name,
                                 FILE *file) {
  const supine_asset *asset = find_asset(assets, name, strlen(name));
  const scope outermost = {data, NULL};
  if (asset != NULL) {
    (void)fill(assets, asset->bytes, asset->bytes + asset->size, &outermost, file);
  }
}

json_t *supine_export_template_base64(const void *bytes, size_t size) {
  static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  const unsigned char *from = bytes;
  size_t length = 0;
  char *text = malloc((size + 2) / 3 * 4 + 1);
  if (text == NULL) {
    return NULL;
  }
  for (size_t i = 0; i < size; i += 3) {
    const size_t left = size - i;
    const uint32_t group = ((uint32_t)from[i] << 16) | (left > 1 ? (uint32_t)from[i + 1] << 8 : 0) |
                           (left > 2 ? (uint32_t)from[i + 2] : 0);
    for (unsigned digit = 0; digit < 4; ++digit) {
      text[length++] = digit <= left ? digits[group >> (18 - 6 * digit) & 63] : '=';
    }
  }
  json_t *made = json_stringn_nocheck(text, length);
  free(text);
  return made;
}
