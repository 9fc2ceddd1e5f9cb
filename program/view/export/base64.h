/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Encode bytes as base64 (RFC 4648, section 4). */
#ifndef SUPINE_EXPORT_BASE64_H
#define SUPINE_EXPORT_BASE64_H

#include <stddef.h>
#include <stdio.h>

/** Write `size` bytes as base64 with padding. A write error sets the error indicator of `file`. */
void supine_export_base64_write(const void *bytes, size_t size, FILE *file);

#endif
