/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * One small language for everything that is written as HTML:
 *
 *     {{name}}                a string or number of the data, escaped; or another asset, a .html
 *                             filled with the same data, anything else as it is
 *     {{#name}} ... {{/name}} once for each element of a list, once for an object or a value that
 *                             is true; not at all where there is none
 *     {{.}}                   the element itself
 *
 * Inside a section its element's names come first, then those around it. A line's end right after
 * a section's tag is left out. */
#ifndef SUPINE_TEMPLATE_H
#define SUPINE_TEMPLATE_H

#include <stdio.h>

#include <jansson.h>

/** A file that the build puts into the program (supine_embed); its array ends with a name of NULL.
 */
typedef struct supine_asset {
  const char *name;  /**< "page.css" */
  const char *bytes; /**< ends with a 0 that `size` does not count */
  size_t size;
} supine_asset;

/** The asset of that name, `length` bytes long, or NULL. */
const supine_asset *supine_template_asset(const supine_asset *assets, const char *name,
                                          size_t length);

/** What fills a template. */
typedef struct supine_template {
  const supine_asset *assets;
  const json_t *data;
  /** Writes what is too large to be data; NULL: there is no such thing. */
  void (*write)(const void *context, const char *name, FILE *file);
  const void *context;
} supine_template;

/** Writes the asset `name`, filled. Names that nothing knows write nothing: supine_embed refuses
 * them when the program is built. Errors of writing are left to be found when the file is closed.
 */
void supine_template_fill(const supine_template *filling, const char *name, FILE *file);

/** Return numbers as an array. */
json_t *supine_template_numbers(const double *values, size_t count);

/** Text with the characters that HTML reserves replaced: & < > ". */
void supine_template_escape(const char *text, FILE *file);

#endif
