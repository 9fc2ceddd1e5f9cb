/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The page: page.html with its other sources and the basis. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sh/base/output.h"

#include "program/export/base64.h"
#include "program/export/export.h"
#include "program/export/template.h"
#include "program/render/render.h"

extern const supine_asset supine_export_assets[]; /* page/, put in by the build */

/* Counts of 16 bits go from -COUNT_MAX to COUNT_MAX. */
enum { COUNT_MAX = 32767 };

/* How the lungs and what is inside move, ready to be counted. */
typedef struct page {
  const export_source *source;
  const export_page *shown;
  double unit[EXPORT_PAGE_MODES_MAX];        /* mm per count, for each mode of the lungs */
  double inside_unit[EXPORT_PAGE_MODES_MAX]; /* mm per count, for each mode of the embedded
                                                structures */
} page;

static void write_tensor(FILE *file, const char *name, const void *bytes, size_t size) {
  (void)fprintf(file, "<script type=\"text/plain\" id=\"tensor-%s\">", name);
  supine_export_base64_write(bytes, size, file);
  (void)fputs("</script>\n", file);
}

/* Return a vertex's direction as in the file; its length is moved into the coefficients. */
static double length_of_direction(const export_source *s, size_t vertex) {
  const float *d = s->direction + 3 * vertex;
  const double length = hypot(hypot((double)d[0], (double)d[1]), (double)d[2]);
  return length > 0 ? length : 1;
}

static double direction_at(const page *p, size_t i) {
  return COUNT_MAX * (double)p->source->direction[i] / length_of_direction(p->source, i / 3);
}

static double coefficient_at(const page *p, size_t i) {
  const size_t k = p->source->info->mode_count;
  return (double)p->source->coefficients[i] * length_of_direction(p->source, i / k) /
         p->unit[i % k];
}

static double inside_at(const page *p, size_t i) {
  return (double)p->shown->inside->coefficients[i] /
         p->inside_unit[i % p->source->info->mode_count];
}

/* Numbers rounded to 16 bits: as many at once as make whole groups of 3 bytes, so that base64 has
 * no remainder between. */
static void write_counts(FILE *file, const char *name, const page *p, size_t count,
                         double (*at)(const page *p, size_t i)) {
  enum { AT_ONCE = 3072 };
  int16_t counts[AT_ONCE];
  (void)fprintf(file, "<script type=\"text/plain\" id=\"tensor-%s\">", name);
  for (size_t i = 0; i < count; i += AT_ONCE) {
    const size_t some = count - i < AT_ONCE ? count - i : AT_ONCE;
    for (size_t j = 0; j < some; ++j) {
      counts[j] = (int16_t)lrint(at(p, i + j));
    }
    supine_export_base64_write(counts, some * sizeof *counts, file);
  }
  (void)fputs("</script>\n", file);
}

/* Units in which each mode's largest number is COUNT_MAX. */
static void find_units(page *p) {
  const size_t n = p->source->info->vertex_count;
  const size_t k = p->source->info->mode_count;
  for (size_t i = 0; i < k; ++i) {
    p->unit[i] = p->inside_unit[i] = 0;
  }
  for (size_t i = 0; i < n * k; ++i) {
    const double c = (double)p->source->coefficients[i] * length_of_direction(p->source, i / k);
    p->unit[i % k] = fmax(p->unit[i % k], fabs(c) / COUNT_MAX);
  }
  if (p->shown->inside != NULL) {
    for (size_t i = 0; i < 3 * k * p->shown->inside->info->vertex_count; ++i) {
      const double c = fabs((double)p->shown->inside->coefficients[i]);
      p->inside_unit[i % k] = fmax(p->inside_unit[i % k], c / COUNT_MAX);
    }
  }
  for (size_t i = 0; i < k; ++i) { /* a mode without displacement needs no unit */
    p->unit[i] = p->unit[i] > 0 ? p->unit[i] : 1;
    p->inside_unit[i] = p->inside_unit[i] > 0 ? p->inside_unit[i] : 1;
  }
}

/* Write triangles as 16-bit indices where these can number every vertex, else as 32-bit ones. */
static void write_triangles(FILE *file, const char *name, const export_source *s) {
  enum { AT_ONCE = 3072 };
  uint16_t corners[AT_ONCE];
  const size_t count = 3 * s->info->triangle_count;
  if (s->info->vertex_count > UINT16_MAX + (size_t)1) {
    write_tensor(file, name, s->triangles, count * sizeof *s->triangles);
    return;
  }
  (void)fprintf(file, "<script type=\"text/plain\" id=\"tensor-%s\">", name);
  for (size_t i = 0; i < count; i += AT_ONCE) {
    const size_t some = count - i < AT_ONCE ? count - i : AT_ONCE;
    for (size_t j = 0; j < some; ++j) {
      corners[j] = (uint16_t)s->triangles[i + j];
    }
    supine_export_base64_write(corners, some * sizeof *corners, file);
  }
  (void)fputs("</script>\n", file);
}

/* A tensor of doubles as the basis has it. */
static void write_all(FILE *file, const char *name, const export_source *s, const char *of) {
  const supine_tensor *tensor = supine_basis_tensor(s->basis, of);
  size_t bytes = sizeof(double);
  for (size_t i = 0; i < tensor->rank; ++i) {
    bytes *= tensor->shape[i];
  }
  write_tensor(file, name, tensor->data, bytes);
}

/* The normals' words, some vertices after the other: 12 bytes of each word and vertex, so that
 * base64 has no remainder between. */
static void write_normals(FILE *file, const export_source *s) {
  enum { AT_ONCE = 256 };
  uint32_t words[AT_ONCE * (SUPINE_NORMAL_MODES_MAX + 2)];
  const size_t n = s->info->vertex_count;
  const size_t modes = s->info->normal_count;
  (void)fputs("<script type=\"text/plain\" id=\"tensor-normals\">", file);
  for (size_t i = 0; i < n; i += AT_ONCE) {
    const size_t end = i + AT_ONCE < n ? i + AT_ONCE : n;
    (void)supine_gl_pack_normals(s->basis, i, end, words);
    supine_export_base64_write(words, (end - i) * ((modes + 2) / 3) * 3 * sizeof *words, file);
  }
  (void)fputs("</script>\n", file);
  write_all(file, "normal-weights", s, "normal_weights");
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

static json_t *numbers(const double *values, size_t count) {
  json_t *list = json_array();
  for (size_t i = 0; i < count; ++i) {
    (void)json_array_append_new(list, json_real(values[i]));
  }
  return list;
}

static json_t *lung_begins(const supine_basis_info *info) {
  json_t *list = json_array();
  for (size_t i = 0; i <= info->lung_count; ++i) {
    (void)json_array_append_new(list, json_integer((json_int_t)info->lung_begin[i]));
  }
  return list;
}

/* Return the embedded structures as JSON, or null. */
static json_t *describe_inside(const page *p) {
  if (p->shown->inside == NULL) {
    return json_null();
  }
  const supine_basis_info *info = p->shown->inside->info;
  json_t *names = json_array();
  for (size_t i = 0; i < p->shown->parts->count; ++i) {
    json_t *name = json_string(p->shown->parts->name[i]);
    (void)json_array_append_new(names, name != NULL ? name : json_string("?")); /* not UTF-8 */
  }
  const supine_tensor *rigid = supine_basis_tensor(p->shown->inside->basis, "rigid");
  json_t *parts = json_array();
  for (size_t i = 0; rigid != NULL && i < rigid->shape[0]; ++i) {
    const uint32_t first = ((const uint32_t *)rigid->data)[2 * i];
    (void)json_array_append_new(parts, json_integer((json_int_t)p->shown->parts->of[first]));
  }
  return json_pack("{s:I, s:o, s:o, s:o, s:o}", "vertices", (json_int_t)info->vertex_count,
                   "lungBegin", lung_begins(info), "names", names, "rigid", parts, "units",
                   numbers(p->inside_unit, info->mode_count));
}

/* mL of the scan beyond the reference surface. */
static double scan_volume(const export_source *s) {
  const supine_state scan = supine_basis_scan(s->basis);
  double held[SUPINE_LUNGS_MAX];
  double beyond = 0;
  supine_pose pose;
  supine_error error;
  if (!s->info->has_volume || supine_basis_pose(s->basis, &scan, &pose, &error) != SUPINE_OK) {
    return 0;
  }
  supine_basis_volumes(s->basis, &pose, held);
  for (size_t lung = 0; lung < s->info->lung_count; ++lung) {
    beyond += held[lung] - s->info->reference_volume[lung];
  }
  return beyond;
}

/* State that displacements are measured from. */
static json_t *describe_from(const page *p) {
  return json_pack("{s:s, s:o, s:o}", "name", p->shown->from_name, "weights",
                   numbers(p->shown->from->weights, p->source->info->mode_count), "gains",
                   numbers(p->shown->from->gains[0], 3 * p->source->info->lung_count));
}

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
                                     "full_upright_gain",
                                     "law",
                                     "error_rms_percent",
                                     "error_p95_percent",
                                     "error_rms_mm",
                                     "error_volume_ml",
                                     "expected_error_mm",
                                     "resting_known",
                                     "scan_state",
                                     "attribution",
                                     "made_by"};
  const supine_basis_info *info = p->source->info;
  json_t *metadata = json_object();
  for (size_t i = 0; i < sizeof keys / sizeof *keys; ++i) {
    const char *value = supine_basis_metadata(p->source->basis, keys[i]);
    if (value != NULL) {
      (void)json_object_set_new(metadata, keys[i], json_string(value));
    }
  }
  json_t *title = json_string(p->shown->title);
  const export_breath *breath = &p->shown->breath;
  return json_pack(
      "{s:I, s:I, s:I, s:I, s:I, s:o, s:b, s:b, s:o, s:f, s:f, s:f, s:o, s:o, s:o, s:o, s:o, s:o, "
      "s:f, s:I, s:o}",
      "vertices", (json_int_t)info->vertex_count, "triangles", (json_int_t)info->triangle_count,
      "modes", (json_int_t)info->mode_count, "normalModes", (json_int_t)info->normal_count, "band",
      (json_int_t)info->band, "lungBegin", lung_begins(info), "hasVolume", (int)info->has_volume,
      "hasResting", (int)(p->source->info->has_rest), "colours", colours(), "breathVolume",
      breath->volume, "breathLargest", breath->largest, "breathScale", breath->scale, "metadata",
      metadata, "title", title != NULL ? title : json_string("lungs"), "units",
      numbers(p->unit, info->mode_count), "inside", describe_inside(p), "from", describe_from(p),
      "references", numbers(info->reference_volume, info->lung_count), "scanVolume",
      scan_volume(p->source), "volumeAxes", (json_int_t)info->volume_axes, "bend",
      numbers(info->bend, 3));
}

/* {{tensors}} */
static void write_tensors(const void *context, const char *name, FILE *file) {
  const page *p = context;
  const export_source *s = p->source;
  if (strcmp(name, "tensors") != 0) {
    return;
  }
  const size_t n = s->info->vertex_count;
  const size_t k = s->info->mode_count;
  write_tensor(file, "vertices", s->vertices, 3 * n * sizeof *s->vertices);
  write_counts(file, "direction", p, 3 * n, direction_at);
  write_counts(file, "coefficients", p, n * k, coefficient_at);
  write_triangles(file, "triangles", s);
  write_tensor(file, "modes", s->modes, k * s->terms * sizeof *s->modes);
  if (s->info->normal_count > 0) {
    write_normals(file, s);
  }
  if (s->info->has_rest) {
    write_all(file, "resting", s, "resting_volume");
  }
  if (s->info->has_volume) {
    write_all(file, "linear", s, "volume_linear");
    write_all(file, "quadratic", s, "volume_quadratic");
    write_all(file, "cubic", s, "volume_cubic");
  }
  if (p->shown->inside != NULL) {
    const export_source *inside = p->shown->inside;
    const size_t m = inside->info->vertex_count;
    write_tensor(file, "inside-vertices", inside->vertices, 3 * m * sizeof *inside->vertices);
    write_counts(file, "inside-coefficients", p, 3 * m * k, inside_at);
    write_triangles(file, "inside-triangles", inside);
    write_tensor(file, "inside-parts", p->shown->parts->of, m * sizeof *p->shown->parts->of);
  }
}

supine_status supine_export_html_print(FILE *file, const export_source *source,
                                       const export_page *shown, supine_error *error) {
  const supine_basis_info *info = source->info;
  if (info->vector || info->mode_count > EXPORT_PAGE_MODES_MAX) {
    return supine_error_set(error, SUPINE_ERROR_UNSUPPORTED,
                            "a page shows scalar bases of up to %d modes; this one is %s of %zu: "
                            "precompute it with --modes %d, or export .glb",
                            EXPORT_PAGE_MODES_MAX, info->vector ? "a vector basis" : "scalar",
                            info->mode_count, EXPORT_PAGE_MODES_MAX);
  }
  page p = {.source = source, .shown = shown};
  find_units(&p);
  json_t *description = describe(&p);
  char *text = json_dumps(description, JSON_COMPACT);
  json_t *data =
      json_pack("{s:O, s:s}", "title", json_object_get(description, "title"), "basis", text);
  const supine_template page_template = {supine_export_assets, data, write_tensors, &p};
  supine_template_fill(&page_template, "page.html", file);
  free(text);
  json_decref(data);
  json_decref(description);
  return SUPINE_OK;
}

supine_status supine_export_html_write(const char *path, const export_source *source,
                                       const export_page *shown, supine_error *error) {
  supine_output output = {0};
  supine_status status = supine_output_open(path, &output, error);
  if (status == SUPINE_OK) {
    status = supine_export_html_print(output.file, source, shown, error);
  }
  if (status == SUPINE_OK) {
    status = supine_output_commit(&output, error);
  }
  supine_output_abandon(&output);
  return status;
}
