/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Files that the build puts into the program: supine_embed in CMakeLists.txt makes a room's array.
 */
#ifndef SUPINE_TEMPLATE_ASSETS_H
#define SUPINE_TEMPLATE_ASSETS_H

#include <stddef.h>

/** One of them; the array ends with a name of NULL. */
typedef struct supine_asset {
  const char *name;  /**< "page.css" */
  const char *bytes; /**< ends with a 0 that `size` does not count */
  size_t size;
} supine_asset;

/** The asset of that name, `length` bytes long, or NULL. */
const supine_asset *supine_template_asset(const supine_asset *assets, const char *name,
                                          size_t length);

#endif
