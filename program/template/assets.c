/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "program/template/assets.h"

#include <string.h>

const supine_asset *supine_template_asset(const supine_asset *assets, const char *name,
                                          size_t length) {
  for (const supine_asset *a = assets; a->name != NULL; ++a) {
    if (strlen(a->name) == length && memcmp(a->name, name, length) == 0) {
      return a;
    }
  }
  return NULL;
}
