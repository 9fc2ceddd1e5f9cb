/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Fill the templates of the page and the report:
 *
 *     {{name}}                a string or number of the data, escaped; else the asset of that name,
 *                             a .html filled with the same data, any other file unchanged
 *     {{#name}} ... {{/name}} repeated for each element of a list; once for an object, a string, a
 *                             number or true; omitted for false, null or an unknown name
 *     {{.}}                   the element itself
 *
 * Inside a section, names are looked up in its element first, then in those around it. A newline
 * right after the tag of a section is omitted. */
#ifndef SUPINE_TEMPLATE_H
#define SUPINE_TEMPLATE_H

#include <stdio.h>

#include <jansson.h>

/** A file embedded in the program by supine_embed; an array of them ends with a NULL name. */
typedef struct supine_asset {
  const char *name;  /**< file name, as "page.css" */
  const char *bytes; /**< ends with a 0 that `size` does not count */
  size_t size;
} supine_asset;

/** Return the asset whose name is the first `length` bytes of `name`, or NULL. */
const supine_asset *supine_template_asset(const supine_asset *assets, const char *name,
                                          size_t length);

/** Assets and data to fill a template with. */
typedef struct supine_template {
  const supine_asset *assets;
  const json_t *data;
  /** Write what is too large for JSON in place of a name that is neither data nor an asset; or
   * NULL. */
  void (*write)(const void *context, const char *name, FILE *file);
  const void *context;
} supine_template;

/** Write the asset `name` with its tags filled. Unknown names write nothing; supine_embed refuses
 * them when the program is built. Write errors stay in the stream. */
void supine_template_fill(const supine_template *filling, const char *name, FILE *file);

/** Return numbers as a JSON array. */
json_t *supine_template_numbers(const double *values, size_t count);

/** Write text with the reserved characters of HTML, & < > ", replaced. */
void supine_template_escape(const char *text, FILE *file);

#endif
