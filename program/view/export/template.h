/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Fill the templates of the page and the report:
 *
 *     {{name}}                a string or number of the data, escaped; or the asset of that name:
 *                             .html is filled with the same data, any other file is copied
 *     {{#name}} ... {{/name}} a section, written for each element of a list; written once for an
 *                             object, a string, a number or true; omitted for false, null or an
 *                             unknown name
 *     {{.}}                   the element of the list, or the value of the section
 *
 * Inside a section, a name is looked up in the element (or value) first, then in the enclosing
 * sections. A newline right after the tag of a section is omitted. */
#ifndef SUPINE_TEMPLATE_H
#define SUPINE_TEMPLATE_H

#include <stdio.h>

#include <jansson.h>

/** A file that the CMake function supine_embed puts into the program. An array of assets ends with
 * the name NULL. */
typedef struct supine_asset {
  const char *name;  /**< for example "page.css" */
  const char *bytes; /**< content, followed by a zero byte, which `size` does not count */
  size_t size;
} supine_asset;

/** Write the asset `name` with its tags filled from `data` and the other assets. Tags with unknown
 * names write nothing; supine_embed refuses such tags when the program is built. A write error sets
 * the error indicator of `file`. */
void supine_export_template_fill(const supine_asset *assets, const json_t *data, const char *name,
                                 FILE *file);

/** Return bytes as base64 with padding (RFC 4648, section 4), or NULL if out of memory. */
json_t *supine_export_template_base64(const void *bytes, size_t size);

#endif
