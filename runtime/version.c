/* SPDX-License-Identifier: MIT */
#include <supine/version.h>

const char *supine_version(void) {
  return SUPINE_VERSION;
}
