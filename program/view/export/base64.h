/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Encode bytes as base64 (RFC 4648, section 4). */
#ifndef SUPINE_EXPORT_BASE64_H
#define SUPINE_EXPORT_BASE64_H

#include <stddef.h>

#include <jansson.h>

/** Return bytes as base64 with padding, or NULL if out of memory. */
json_t *supine_export_base64(const void *bytes, size_t size);

#endif
