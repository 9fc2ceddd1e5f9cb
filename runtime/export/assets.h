/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * The page's sources, which the build puts into the program. */
#ifndef SUPINE_EXPORT_ASSETS_H
#define SUPINE_EXPORT_ASSETS_H

#include <stddef.h>

typedef struct export_asset {
  const char *name; /**< "page.css" */
  const unsigned char *bytes;
  size_t size;
} export_asset;

extern const export_asset supine_export_assets[];
extern const size_t supine_export_asset_count;

#endif
