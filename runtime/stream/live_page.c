/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The exported page, allowed to open a socket to where it came from, and with live.js in it. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "runtime/export/export.h"
#include "runtime/stream/live_page.h"
#include "runtime/template/assets.h"

extern const supine_asset supine_stream_assets[]; /* live.js, put in by the build */

/* The page may talk to nobody; this one to its server. 'self' means its WebSocket too, but not in
 * every browser. */
static const char silent[] = "default-src 'none';";
static const char talking[] = "default-src 'none'; connect-src 'self' ws: wss:;";

static supine_status read_back(const char *path, char **bytes, size_t *size, supine_error *error) {
  FILE *file = fopen(path, "rb");
  long length = -1;
  if (file != NULL && fseek(file, 0, SEEK_END) == 0) {
    length = ftell(file);
  }
  *bytes = length < 0 ? NULL : malloc((size_t)length + 1);
  *size = length < 0 ? 0 : (size_t)length;
  bool good = false;
  if (*bytes != NULL) {
    rewind(file);
    good = fread(*bytes, 1, *size, file) == *size;
  }
  if (file != NULL) {
    (void)fclose(file);
  }
  if (!good) {
    free(*bytes);
    return supine_error_set(error, SUPINE_ERROR_READ, "%s: cannot be read back", path);
  }
  return SUPINE_OK;
}

/* `page` with the first `from` replaced by `to`. */
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

supine_status supine_stream_live_page(const char *basis, double breath, const char *title,
                                      char **page, size_t *size, supine_error *error) {
  char folder[] = "/tmp/supine-live-XXXXXX";
  char path[sizeof folder + 16];
  export_source source = {0};
  export_breath deep = {0};
  *page = NULL;
  supine_status status = supine_export_source_open(basis, &source, error);
  if (status == SUPINE_OK) {
    status = supine_export_breath_set(&source, breath, 20.0, &deep, error);
  }
  if (status == SUPINE_OK && mkdtemp(folder) == NULL) {
    status = supine_error_set(error, SUPINE_ERROR_WRITE, "no temporary folder can be made in /tmp");
  }
  if (status == SUPINE_OK) {
    (void)snprintf(path, sizeof path, "%s/page.html", folder);
    status = supine_export_html_write(path, &source, &deep, title, error);
    if (status == SUPINE_OK) {
      status = read_back(path, page, size, error);
    }
    (void)unlink(path);
    (void)rmdir(folder);
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
      status = supine_error_set(error, SUPINE_ERROR_MEMORY, "the page cannot be made to follow");
    }
  }
  return status;
}
