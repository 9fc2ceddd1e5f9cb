/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * The exported page, made to follow. */
#ifndef SUPINE_STREAM_LIVE_PAGE_H
#define SUPINE_STREAM_LIVE_PAGE_H

#include <stddef.h>

#include <supine/status.h>

/** The page of a basis file with the script that follows, as bytes (free).
 * @retval SUPINE_ERROR_UNSUPPORTED  a basis that the page cannot show
 * Other statuses as supine_export_source_open and supine_export_html_write. */
supine_status supine_stream_live_page(const char *basis, double breath, const char *title,
                                      char **page, size_t *size, supine_error *error);

#endif
