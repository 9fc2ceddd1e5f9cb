/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Make the live page: the exported page with a script that shows each state the server sends. */
#ifndef SUPINE_STREAM_LIVE_PAGE_H
#define SUPINE_STREAM_LIVE_PAGE_H

#include <stddef.h>

#include "program/export/export.h"

/** Make the page of a basis file; the caller frees it.
 * @param shown  content of the page; of its breath only the volume is used
 * @retval SUPINE_ERROR_UNSUPPORTED  a basis that the page cannot show
 * Other statuses as supine_export_source_open and supine_export_html_write. */
supine_status supine_stream_live_page(const char *basis, const export_page *shown, char **page,
                                      size_t *size, supine_error *error);

#endif
