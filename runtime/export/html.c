/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The page: page.html with its other sources and the basis. */
#include <stdlib.h>
#include <string.h>

#include "sh/base/output.h"

#include "runtime/export/base64.h"
#include "runtime/export/export.h"
#include "runtime/render/render.h"
#include "runtime/template/template.h"

extern const supine_asset supine_export_assets[]; /* page/, put in by the build */

typedef struct page {
  const export_source *source;
  const export_breath *breath;
  const char *title;
} page;

static void write_tensor(FILE *file, const char *name, const void *bytes, size_t size) {
  (void)fprintf(file, "<script type=\"text/plain\" id=\"tensor-%s\">", name);
  supine_export_base64_write(bytes, size, file);
  (void)fputs("</script>\n", file);
}

/* The normals' words, some vertices after the other: 12 bytes of each word and vertex, so that
 * base64 has no remainder between. */
static void write_normals(FILE *file, const export_source *s) {
  enum { AT_ONCE = 256 };
  uint32_t words[AT_ONCE * (SUPINE_NORMAL_MODES_MAX + 2)];
  const size_t n = s->info->vertex_count;
  const size_t modes = s->info->normal_count;
  const size_t terms = (s->info->mode_count + 1) * (s->info->mode_count + 2) / 2;
  (void)fputs("<script type=\"text/plain\" id=\"tensor-normals\">", file);
  for (size_t i = 0; i < n; i += AT_ONCE) {
    const size_t end = i + AT_ONCE < n ? i + AT_ONCE : n;
    (void)supine_gl_pack_normals(s->basis, i, end, words);
    supine_export_base64_write(words, (end - i) * ((modes + 2) / 3) * 3 * sizeof *words, file);
  }
  (void)fputs("</script>\n", file);
  write_tensor(file, "normal-weights", s->info->normal_weights,
               s->info->lung_count * modes * terms * sizeof(double));
}

/* Each map's 256 colours as hexadecimal digits. */
static json_t *colours(void) {
  static const char *const names[SUPINE_COLOURS_COUNT] = {"displacement", "difference"};
  enum { COLOURS = 256 };
  json_t *maps = json_object();
  for (supine_colours map = 0; map < SUPINE_COLOURS_COUNT; ++map) {
    char text[6 * COLOURS + 1];
    for (int i = 0; i < COLOURS; ++i) {
      double rgb[3];
      supine_render_colour(map, i / (double)(COLOURS - 1), rgb);
      for (int k = 0; k < 3; ++k) {
        (void)snprintf(text + 6 * i + 2 * k, 3, "%02x", (unsigned)(255 * rgb[k] + 0.5) & 255U);
      }
    }
    (void)json_object_set_new(maps, names[map], json_string(text));
  }
  return maps;
}

/* Sizes and metadata. */
static json_t *describe(const page *p) {
  static const char *const keys[] = {"lungs",
                                     "modes",
                                     "force",
                                     "direction",
                                     "direction_constants",
                                     "stiffness",
                                     "reference_volume_ml",
                                     "scan_volume_ml",
                                     "scanned",
                                     "law",
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
  return json_pack(
      "{s:I, s:I, s:I, s:I, s:I, s:o, s:b, s:b, s:o, s:f, s:f, s:f, s:o, s:o}", "vertices",
      (json_int_t)info->vertex_count, "triangles", (json_int_t)info->triangle_count, "modes",
      (json_int_t)info->mode_count, "normalModes", (json_int_t)info->normal_count, "band",
      (json_int_t)info->band, "lungBegin", lungs, "hasVolume", (int)info->has_volume, "hasResting",
      (int)(p->source->resting != NULL), "colours", colours(), "breathVolume", p->breath->volume,
      "breathLargest", p->breath->largest, "breathScale", p->breath->scale, "metadata", metadata,
      "title", title != NULL ? title : json_string("lungs"));
}

/* {{tensors}} */
static void write_tensors(const void *context, const char *name, FILE *file) {
  const export_source *s = context;
  if (strcmp(name, "tensors") != 0) {
    return;
  }
  const size_t n = s->info->vertex_count;
  const size_t k = s->info->mode_count;
  const size_t g = s->info->lung_count;
  write_tensor(file, "vertices", s->vertices, 3 * n * sizeof *s->vertices);
  write_tensor(file, "direction", s->direction, 3 * n * sizeof *s->direction);
  write_tensor(file, "coefficients", s->coefficients, n * k * sizeof *s->coefficients);
  write_tensor(file, "triangles", s->triangles, 3 * s->info->triangle_count * sizeof *s->triangles);
  write_tensor(file, "modes", s->modes, k * s->terms * sizeof *s->modes);
  if (s->info->normal_count > 0) {
    write_normals(file, s);
  }
  if (s->resting != NULL) {
    write_tensor(file, "resting", s->resting, EXPORT_RESTING_TERMS * sizeof *s->resting);
  }
  if (s->info->has_volume) {
    write_tensor(file, "linear", s->linear, g * k * sizeof *s->linear);
    write_tensor(file, "quadratic", s->quadratic, g * k * k * sizeof *s->quadratic);
    write_tensor(file, "cubic", s->cubic, g * k * k * k * sizeof *s->cubic);
  }
}

supine_status supine_export_html_print(FILE *file, const export_source *source,
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
  const page p = {source, breath, title};
  json_t *description = describe(&p);
  char *text = json_dumps(description, JSON_COMPACT);
  json_t *data =
      json_pack("{s:O, s:s}", "title", json_object_get(description, "title"), "basis", text);
  const supine_template page_template = {supine_export_assets, data, write_tensors, source};
  supine_template_fill(&page_template, "page.html", file);
  free(text);
  json_decref(data);
  json_decref(description);
  return SUPINE_OK;
}

supine_status supine_export_html_write(const char *path, const export_source *source,
                                       const export_breath *breath, const char *title,
                                       supine_error *error) {
  supine_output output = {0};
  supine_status status = supine_output_open(path, &output, error);
  if (status == SUPINE_OK) {
    status = supine_export_html_print(output.file, source, breath, title, error);
  }
  if (status == SUPINE_OK) {
    status = supine_output_commit(&output, error);
  }
  supine_output_abandon(&output);
  return status;
}
