/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The page: page.html with its other sources and the basis put in where {{...}} names them. */
#include <stdlib.h>
#include <string.h>

#include "sh/base/output.h"
#include <jansson.h>

#include "runtime/export/assets.h"
#include "runtime/export/base64.h"
#include "runtime/export/export.h"

typedef struct page {
  const export_source *source;
  const export_breath *breath;
  const char *title;
  FILE *file;
} page;

/* Text between tags. */
static void write_escaped(const char *text, FILE *file) {
  for (const char *c = text; *c != '\0'; ++c) {
    switch (*c) {
    case '<':
      (void)fputs("&lt;", file);
      break;
    case '&':
      (void)fputs("&amp;", file);
      break;
    default:
      (void)fputc(*c, file);
    }
  }
}

/* JSON within a script element: no "<" may stand there, which only strings could hold. */
static void write_json(const json_t *value, FILE *file) {
  char *text = json_dumps(value, JSON_COMPACT);
  for (const char *c = text; c != NULL && *c != '\0'; ++c) {
    if (*c == '<') {
      (void)fputs("\\u003c", file);
    } else {
      (void)fputc(*c, file);
    }
  }
  free(text);
}

static void write_tensor(const page *p, const char *name, const void *bytes, size_t size) {
  (void)fprintf(p->file, "<script type=\"text/plain\" id=\"tensor-%s\">", name);
  supine_export_base64_write(bytes, size, p->file);
  (void)fputs("</script>\n", p->file);
}

/* Sizes and metadata. */
static json_t *describe(const page *p) {
  static const char *const keys[] = {"lungs",
                                     "modes",
                                     "force",
                                     "direction",
                                     "direction_constants",
                                     "stiffness",
                                     "rest_volume_ml",
                                     "error_rms_percent",
                                     "error_p95_percent",
                                     "error_rms_mm",
                                     "error_volume_ml",
                                     "attribution",
                                     "made_by"};
  const supine_basis_info *info = p->source->info;
  json_t *lungs = json_array();
  json_t *metadata = json_object();
  for (size_t i = 0; i <= info->lung_count; ++i) {
    (void)json_array_append_new(lungs, json_integer((json_int_t)info->lung_begin[i]));
  }
  for (size_t i = 0; i < sizeof keys / sizeof *keys; ++i) {
    const char *value = supine_basis_metadata(p->source->basis, keys[i]);
    if (value != NULL) {
      (void)json_object_set_new(metadata, keys[i], json_string(value));
    }
  }
  json_t *title = json_string(p->title);
  return json_pack("{s:I, s:I, s:I, s:I, s:o, s:b, s:f, s:f, s:f, s:o, s:o}", "vertices",
                   (json_int_t)info->vertex_count, "triangles", (json_int_t)info->triangle_count,
                   "modes", (json_int_t)info->mode_count, "band", (json_int_t)info->band,
                   "lungBegin", lungs, "hasVolume", (int)info->has_volume, "breathVolume",
                   p->breath->volume, "breathLargest", p->breath->largest, "breathScale",
                   p->breath->scale, "metadata", metadata, "title",
                   title != NULL ? title : json_string("lungs"));
}

static void write_basis(const page *p) {
  const export_source *s = p->source;
  const size_t n = s->info->vertex_count;
  const size_t k = s->info->mode_count;
  const size_t g = s->info->lung_count;
  json_t *description = describe(p);
  (void)fputs("<script type=\"application/json\" id=\"basis\">", p->file);
  write_json(description, p->file);
  (void)fputs("</script>\n", p->file);
  json_decref(description);
  write_tensor(p, "vertices", s->vertices, 3 * n * sizeof *s->vertices);
  write_tensor(p, "direction", s->direction, 3 * n * sizeof *s->direction);
  write_tensor(p, "coefficients", s->coefficients, n * k * sizeof *s->coefficients);
  write_tensor(p, "triangles", s->triangles, 3 * s->info->triangle_count * sizeof *s->triangles);
  write_tensor(p, "modes", s->modes, k * s->terms * sizeof *s->modes);
  if (s->info->has_volume) {
    write_tensor(p, "linear", s->linear, g * k * sizeof *s->linear);
    write_tensor(p, "quadratic", s->quadratic, g * k * k * sizeof *s->quadratic);
    write_tensor(p, "cubic", s->cubic, g * k * k * k * sizeof *s->cubic);
  }
}

static const export_asset *find_asset(const char *name, size_t length) {
  for (size_t i = 0; i < supine_export_asset_count; ++i) {
    if (strlen(supine_export_assets[i].name) == length &&
        memcmp(supine_export_assets[i].name, name, length) == 0) {
      return &supine_export_assets[i];
    }
  }
  return NULL;
}

/* What stands in the page for {{name}}: "title", "basis", or a source's file name. */
static void write_named(const page *p, const char *name, size_t length) {
  const export_asset *asset = find_asset(name, length);
  if (asset != NULL) {
    (void)fwrite(asset->bytes, 1, asset->size, p->file);
  } else if (length == strlen("basis") && memcmp(name, "basis", length) == 0) {
    write_basis(p);
  } else {
    write_escaped(p->title, p->file);
  }
}

static void write_page(const page *p) {
  const export_asset *frame = find_asset("page.html", strlen("page.html"));
  const char *at = (const char *)frame->bytes;
  const char *end = at + frame->size;
  for (;;) {
    const char *open = memmem(at, (size_t)(end - at), "{{", 2);
    const char *close = open == NULL ? NULL : memmem(open, (size_t)(end - open), "}}", 2);
    if (close == NULL) {
      (void)fwrite(at, 1, (size_t)(end - at), p->file);
      return;
    }
    (void)fwrite(at, 1, (size_t)(open - at), p->file);
    write_named(p, open + 2, (size_t)(close - open) - 2);
    at = close + 2;
  }
}

supine_status supine_export_html_write(const char *path, const export_source *source,
                                       const export_breath *breath, const char *title,
                                       supine_error *error) {
  const supine_basis_info *info = source->info;
  if (info->vector || info->mode_count > EXPORT_PAGE_MODES_MAX) {
    return supine_error_set(error, SUPINE_ERROR_UNSUPPORTED,
                            "a page shows scalar bases of up to %d modes; this one is %s of %zu: "
                            "precompute it with --modes %d, or export .glb",
                            EXPORT_PAGE_MODES_MAX, info->vector ? "a vector basis" : "scalar",
                            info->mode_count, EXPORT_PAGE_MODES_MAX);
  }
  supine_output output = {0};
  supine_status status = supine_output_open(path, &output, error);
  if (status != SUPINE_OK) {
    return status;
  }
  const page p = {source, breath, title, output.file};
  write_page(&p);
  status = supine_output_commit(&output, error);
  supine_output_abandon(&output);
  return status;
}
