/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "program/view/export/template.h"

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
  if (json_is_string(value)) {
    escape(json_string_value(value), file);
  } else if (json_is_integer(value)) {
    (void)fprintf(file, "%" JSON_INTEGER_FORMAT, json_integer_value(value));
  } else {
    (void)json_dumpf(value, file, JSON_ENCODE_ANY | JSON_REAL_PRECISION(9));
  }
}

static void fill(const supine_asset *assets, const char *at, const char *end, const scope *around,
                 FILE *file);

static void write_named(const supine_asset *assets, const tag *named, const scope *around,
                        FILE *file) {
  const json_t *value = look_up(around, named->name, named->length);
  const supine_asset *asset = find_asset(assets, named->name, named->length);
  if (value != NULL) {
    write_value(value, file);
  } else if (asset != NULL && strstr(asset->name, ".html") != NULL) {
    /* Omit the last newline of the asset, because the template has a newline after the tag. */
    const size_t size = asset->size - (asset->bytes[asset->size - 1] == '\n');
    fill(assets, asset->bytes, asset->bytes + size, around, file);
  } else if (asset != NULL) {
    (void)fwrite(asset->bytes, 1, asset->size, file);
  }
}

/* Return the tag that ends a section; its `end` is NULL if there is none. */
static tag find_end(const char *at, const char *end) {
  size_t depth = 1;
  tag found = next_tag(at, end);
  while (found.end != NULL) {
    depth += found.kind == '#';
    depth -= found.kind == '/';
    if (depth == 0) {
      return found;
    }
    found = next_tag(found.end, end);
  }
  return found;
}

static void fill_section(const supine_asset *assets, const tag *open, const char *end,
                         const scope *around, FILE *file) {
  const json_t *value = look_up(around, open->name, open->length);
  const scope inner = {value, around};
  if (json_is_object(value) || json_is_string(value) || json_is_number(value) ||
      json_is_true(value)) {
    fill(assets, open->end, end, &inner, file);
  }
  for (size_t i = 0; i < json_array_size(value); ++i) {
    const scope element = {json_array_get(value, i), around};
    fill(assets, open->end, end, &element, file);
  }
}

static void fill(const supine_asset *assets, const char *at, const char *end, const scope *around,
                 FILE *file) {
  for (tag open = next_tag(at, end); open.end != NULL; open = next_tag(at, end)) {
    (void)fwrite(at, 1, (size_t)(open.begin - at), file);
    at = open.end;
    if (open.kind == 0) {
      write_named(assets, &open, around, file);
    } else {
      const tag close = find_end(at, end);
      fill_section(assets, &open, close.end != NULL ? close.begin : end, around, file);
      at = close.end != NULL ? close.end : end;
    }
  }
  (void)fwrite(at, 1, (size_t)(end - at), file);
}

void supine_template_fill(const supine_asset *assets, const json_t *data, const char *name,
                          FILE *file) {
  const supine_asset *asset = find_asset(assets, name, strlen(name));
  const scope outermost = {data, NULL};
  if (asset != NULL) {
    fill(assets, asset->bytes, asset->bytes + asset->size, &outermost, file);
  }
}
