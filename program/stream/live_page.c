/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Add live.js to the exported page, and allow it to open a socket to its server. */
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "program/export/export.h"
#include "program/export/template.h"
#include "program/stream/live_page.h"

extern const supine_asset supine_stream_assets[]; /* live.js, embedded by the build */

/* Content security policies of the exported page, which may connect nowhere, and of the live page,
 * which may connect to its server and to WebSockets. Not every browser counts WebSockets under
 * 'self', so that they are listed. */
static const char silent[] = "default-src 'none';";
static const char talking[] = "default-src 'none'; connect-src 'self' ws: wss:;";

/* Replace the first `from` in a page, which is freed, and return the result; NULL: not found, or no
 * memory. */
static char *replace(char *page, size_t *size, const char *from, const void *to, size_t to_size) {
  const size_t from_size = strlen(from);
  char *at = page == NULL ? NULL : memmem(page, *size, from, from_size);
  char *changed = at == NULL ? NULL : malloc(*size - from_size + to_size + 1);
  if (changed != NULL) {
    const size_t before = (size_t)(at - page);
    memcpy(changed, page, before);
    memcpy(changed + before, to, to_size);
    memcpy(changed + before + to_size, at + from_size, *size - before - from_size);
    *size += to_size - from_size;
  }
  free(page);
  return changed;
}

static supine_status print_page(const export_source *source, const export_page *shown, char **page,
                                size_t *size, supine_error *error) {
  FILE *file = open_memstream(page, size);
  supine_status status = SUPINE_OK;
  bool whole = file != NULL;
  if (whole) {
    status = supine_export_html_print(file, source, shown, error);
    whole = ferror(file) == 0;
    whole = fclose(file) == 0 && whole;
  }
  if (status == SUPINE_OK && !whole) {
    status = supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for the page");
  }
  if (status != SUPINE_OK) {
    free(*page);
    *page = NULL;
  }
  return status;
}

supine_status supine_stream_live_page(const char *basis, const export_page *shown, char **page,
                                      size_t *size, supine_error *error) {
  export_source source = {0};
  export_page sized = *shown;
  *page = NULL;
  *size = 0;
  supine_status status = supine_export_source_open(basis, &source, error);
  if (status == SUPINE_OK) {
    status = supine_export_breath_set(&source, shown->breath.volume, 20.0, &sized.breath, error);
  }
  if (status == SUPINE_OK) {
    status = print_page(&source, &sized, page, size, error);
  }
  supine_export_source_close(&source);
  if (status == SUPINE_OK) {
    static const char end[] = "</body>";
    char *script = NULL;
    const int length = asprintf(&script, "<script type=\"module\">\n%s</script>\n%s",
                                supine_stream_assets[0].bytes, end);
    *page = replace(*page, size, silent, talking, strlen(talking));
    *page = replace(*page, size, end, script, length < 0 ? 0 : (size_t)length);
    free(script);
    if (*page == NULL) {
      status = supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for the page");
    }
  }
  return status;
}
