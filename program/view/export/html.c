/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Write the HTML page: fill page.html with scripts, shaders and the data of the basis. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"
#include "base/output.h"

#include "program/view/export/base64.h"
#include "program/view/export/packed.h"
#include "program/view/export/template.h"
#include "program/view/render/render.h"

extern const supine_asset supine_export_assets[]; /* the files of program/view/page */

enum { STORED_MAX = 32767 };

/* State while a page is printed. The page stores positions and coefficients as 16-bit integers,
 * which the browser multiplies by a quantisation step. */
typedef struct page {
  const export_source *source;
  const export_page *shown;
  double middle[3];        /* origin of stored positions, mm: centre of the bounding box */
  double position_step;    /* quantisation step of positions, mm */
  double coefficient_step; /* quantisation step of the surface's displacements by modes, mm */
  double inside_step;      /* the same for structures inside the lungs, mm */
  export_order order;      /* order of stored vertices and triangles of the surface */
  supine_status *status;
} page;

static void write_tensor(FILE *file, const char *name, const void *bytes, size_t size) {
  (void)fprintf(file, "<script type=\"text/plain\" id=\"tensor-%s\">", name);
  supine_export_base64_write(bytes, size, file);
  (void)fputs("</script>\n", file);
}

static void write_packed(const page *p, FILE *file, const char *name, supine_status status,
                         export_packed packed) {
  if (status == SUPINE_OK) {
    write_tensor(file, name, packed.bytes, packed.size);
    free(packed.bytes);
  } else {
    *p->status = status;
  }
}

static int16_t quantise(double value, double step) {
  return (int16_t)lrint(value / step);
}

static double length_of(const float v[3]) {
  return hypot(hypot((double)v[0], (double)v[1]), (double)v[2]);
}

static void place_row(const page *p, const export_source *s, size_t vertex, size_t axis,
                      int16_t *row) {
  for (; axis < 3; ++axis) {
    row[axis] =
        quantise((double)s->info->vertices[3 * vertex + axis] - p->middle[axis], p->position_step);
  }
}

static void direction_row(const page *p, const export_source *s, size_t vertex, size_t axis,
                          int16_t *row) {
  static const float none[3] = {0, 0, 1};
  const float *d = s->info->direction + 3 * vertex;
  const float length = (float)length_of(d);
  const float unit[3] = {d[0] / length, d[1] / length, d[2] / length};
  (void)p;
  (void)axis;
  supine_export_pack_direction(length > 0 ? unit : none, 4 * sizeof *row, row);
}

/* Return the length of the vector that multiplies the coefficients of a vertex, mm. */
static double reach_of(const export_source *s, size_t vertex) {
  return s->info->vector ? 1 : length_of(s->info->direction + 3 * vertex);
}

/* Return the number of coefficients of a vertex for each mode. */
static size_t axes_of(const export_source *s) {
  return s->info->vector ? 3 : 1;
}

static void coefficient_row(const page *p, const export_source *s, size_t vertex, size_t axis,
                            int16_t *row) {
  const size_t k = s->info->mode_count;
  const float *from = s->info->coefficients + (vertex * axes_of(s) + axis) * k;
  const double step = s == p->source ? p->coefficient_step : p->inside_step;
  for (size_t i = 0; i < k; ++i) {
    row[i] = quantise((double)from[i] * reach_of(s, vertex), step);
  }
}

typedef void fill_row(const page *p, const export_source *s, size_t vertex, size_t axis,
                      int16_t *row);

/* Compress and write integers of all vertices of a basis, [axes, vertices, columns]. `fill`
 * computes the columns of a vertex on an axis; they are padded to an even number. */
static void write_rows(const page *p, FILE *file, const char *name, const export_source *s,
                       size_t axes, size_t columns, fill_row *fill) {
  const size_t n = s->info->vertex_count;
  const size_t stride = (columns + 1) / 2 * 2;
  export_packed packed = {0};
  supine_status status = SUPINE_ERROR_MEMORY;
  int16_t *rows = calloc(axes * n * stride, sizeof *rows);
  if (rows != NULL) {
    for (size_t i = 0; i < axes * n; ++i) {
      fill(p, s, s == p->source ? p->order.vertex[i % n] : i % n, i / n, rows + i * stride);
    }
    status = supine_export_pack_rows(rows, axes * n, stride * sizeof *rows, &packed);
  }
  write_packed(p, file, name, status, packed);
  free(rows);
}

static void write_corners(const page *p, FILE *file, const char *name, const export_source *s,
                          const uint32_t *corners) {
  export_packed packed = {0};
  const supine_status status = supine_export_pack_corners(corners, 3 * s->info->triangle_count,
                                                          s->info->vertex_count, &packed);
  write_packed(p, file, name, status, packed);
}

/* Return the largest displacement of a vertex along an axis by one mode, mm. */
static double largest_coefficient(const export_source *s) {
  const size_t columns = axes_of(s) * s->info->mode_count;
  double largest = 0;
  for (size_t i = 0; i < s->info->vertex_count * columns; ++i) {
    largest = fmax(largest, fabs((double)s->info->coefficients[i]) * reach_of(s, i / columns));
  }
  return largest;
}

/* Choose the origin of positions and the quantisation steps. Positions then err by at most 0.02 mm,
 * unless larger steps are needed to keep the stored integers below STORED_MAX. */
static void find_steps(page *p) {
  static const double step = 0.005;
  const export_source *s = p->source;
  const export_source *inside = p->shown->inside;
  const size_t k = s->info->mode_count;
  double low[3] = {INFINITY, INFINITY, INFINITY};
  double high[3] = {-INFINITY, -INFINITY, -INFINITY};
  supine_export_box(s, low, high);
  if (inside != NULL) {
    supine_export_box(inside, low, high);
  }
  p->position_step = step;
  for (size_t axis = 0; axis < 3; ++axis) {
    p->middle[axis] = (low[axis] + high[axis]) / 2;
    p->position_step = fmax(p->position_step, (high[axis] - low[axis]) / (2 * STORED_MAX));
  }
  p->coefficient_step = fmax(2 * step / (double)k, largest_coefficient(s) / STORED_MAX);
  p->inside_step =
      inside == NULL ? 1 : fmax(2 * step / (double)k, largest_coefficient(inside) / STORED_MAX);
}

/* Write the tensors of 64-bit floats, such as modes and volume coefficients, uncompressed. */
static void write_doubles(FILE *file, const supine_basis *basis) {
  static const char *const names[] = {"modes", "resting_volume", "volume_linear",
                                      "volume_quadratic", "volume_cubic"};
  for (size_t i = 0; i < sizeof names / sizeof *names; ++i) {
    const supine_tensor *tensor = supine_basis_tensor(basis, names[i]);
    size_t bytes = sizeof(double);
    for (size_t axis = 0; tensor != NULL && axis < tensor->rank; ++axis) {
      bytes *= tensor->shape[axis];
    }
    if (tensor != NULL) {
      write_tensor(file, names[i], tensor->data, bytes);
    }
  }
}

/* Return the 256 colours of each colour map as hexadecimal digits. */
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

/* Return `begin` as a JSON list: the first index of each lung, then the end of the last lung. */
static json_t *begins(const export_source *s, const size_t *begin) {
  json_t *list = json_array();
  for (size_t i = 0; i <= s->info->lung_count; ++i) {
    (void)json_array_append_new(list, json_integer((json_int_t)begin[i]));
  }
  return list;
}

/* Describe the structures inside the lungs as JSON: sizes, names and quantisation step. */
static json_t *describe_inside(const page *p) {
  if (p->shown->inside == NULL) {
    return json_null();
  }
  const supine_basis_info *info = p->shown->inside->info;
  json_t *names = json_array();
  for (size_t i = 0; i < p->shown->parts->count; ++i) {
    json_t *name = json_string(p->shown->parts->name[i]); /* NULL if it is not UTF-8 */
    (void)json_array_append_new(names, name != NULL ? name : json_string("?"));
  }
  const supine_tensor *rigid = supine_basis_tensor(p->shown->inside->basis, "rigid");
  json_t *parts = json_array();
  for (size_t i = 0; rigid != NULL && i < rigid->shape[0]; ++i) {
    const uint32_t first = ((const uint32_t *)rigid->data)[2 * i];
    (void)json_array_append_new(parts, json_integer((json_int_t)p->shown->parts->of[first]));
  }
  return json_pack("{s:I, s:I, s:o, s:o, s:o, s:f}", "vertices", (json_int_t)info->vertex_count,
                   "triangles", (json_int_t)info->triangle_count, "lungBegin",
                   begins(p->shown->inside, info->lung_begin), "names", names, "rigid", parts,
                   "unit", p->inside_step);
}

/* Return the volume of all lungs in the scan minus that of the reference surface, mL; 0 if the pose
 * of the scan cannot be computed. */
static double scan_volume(const export_source *s) {
  const supine_state scan = supine_basis_scan(s->basis);
  double held[SUPINE_LUNGS_MAX];
  double beyond = 0;
  supine_pose pose;
  supine_error error;
  if (supine_basis_pose(s->basis, &scan, &pose, &error) != SUPINE_OK) {
    return 0;
  }
  (void)supine_basis_volumes(s->basis, &pose, held);
  for (size_t lung = 0; lung < s->info->lung_count; ++lung) {
    beyond += held[lung] - s->info->reference_volume[lung];
  }
  return beyond;
}

/* Return the states from which displacements can be measured, as JSON. */
static json_t *describe_froms(const page *p) {
  json_t *list = json_array();
  for (size_t i = 0; i < p->shown->from_count; ++i) {
    const export_reference *from = &p->shown->from[i];
    (void)json_array_append_new(
        list,
        json_pack("{s:s, s:o, s:o, s:o, s:o}", "name", from->name, "gravity",
                  supine_template_numbers(from->gravity, 3), "above",
                  isnan(from->above) ? json_null() : json_real(from->above), "weights",
                  supine_template_numbers(from->pose->weights, p->source->info->mode_count),
                  "gains",
                  supine_template_numbers(from->pose->gains[0], 3 * p->source->info->lung_count)));
  }
  return list;
}

static json_t *describe(const page *p) {
  const supine_basis_info *info = p->source->info;
  json_t *title = json_string(p->shown->title);
  return json_pack(
      "{s:I, s:I, s:I, s:I, s:b, s:o, s:o, s:b, s:o, s:f, s:o, s:o, s:o, s:f, s:f, "
      "s:o, s:o, s:o, s:f, s:I, s:o}",
      "vertices", (json_int_t)info->vertex_count, "triangles", (json_int_t)info->triangle_count,
      "modes", (json_int_t)info->mode_count, "band", (json_int_t)info->band, "vector",
      (int)info->vector, "lungBegin", begins(p->source, info->lung_begin), "cornerBegin",
      begins(p->source, p->order.corner_begin), "hasResting", (int)(p->source->info->has_rest),
      "colours", colours(), "breathVolume", p->shown->breath, "metadata",
      supine_export_metadata(p->source), "title", title != NULL ? title : json_string("lungs"),
      "middle", supine_template_numbers(p->middle, 3), "placeUnit", p->position_step, "unit",
      p->coefficient_step, "inside", describe_inside(p), "froms", describe_froms(p), "references",
      supine_template_numbers(info->reference_volume, info->lung_count), "scanVolume",
      scan_volume(p->source), "volumeAxes", (json_int_t)info->volume_axes, "bend",
      supine_template_numbers(info->bend, 3));
}

/* Write the tensors of the page in place of the tag {{tensors}} of page.html. */
static void write_tensors(const void *context, const char *name, FILE *file) {
  const page *p = context;
  const export_source *s = p->source;
  if (strcmp(name, "tensors") != 0) {
    return;
  }
  write_rows(p, file, "vertices", s, 1, 3, place_row);
  if (!s->info->vector) {
    write_rows(p, file, "direction", s, 1, 4, direction_row);
  }
  write_rows(p, file, "coefficients", s, axes_of(s), s->info->mode_count, coefficient_row);
  write_corners(p, file, "triangles", s, p->order.corners);
  write_doubles(file, s->basis);
  if (p->shown->inside != NULL) {
    const export_source *inside = p->shown->inside;
    write_rows(p, file, "inside-vertices", inside, 1, 3, place_row);
    write_rows(p, file, "inside-coefficients", inside, 3, inside->info->mode_count,
               coefficient_row);
    write_corners(p, file, "inside-triangles", inside, inside->info->triangles);
    write_tensor(file, "inside-parts", p->shown->parts->of,
                 inside->info->vertex_count * sizeof *p->shown->parts->of);
  }
}

static void free_order(page *p) {
  supine_export_order_free(&p->order);
}

supine_status supine_export_html_print(FILE *file, const export_source *source,
                                       const export_page *shown, supine_error *error) {
  const supine_basis_info *info = source->info;
  if (info->mode_count > EXPORT_PAGE_MODES_MAX) {
    return supine_error_set(error, SUPINE_ERROR_UNSUPPORTED,
                            "a page shows up to %d modes, not %zu: precompute the basis with "
                            "--modes %d, or export .glb",
                            EXPORT_PAGE_MODES_MAX, info->mode_count, EXPORT_PAGE_MODES_MAX);
  }
  SUPINE_TRY(supine_export_pack_begin(error));
  supine_status status = SUPINE_OK;
  SUPINE_FREED_BY(free_order) page p = {.source = source, .shown = shown, .status = &status};
  SUPINE_TRY(supine_export_order_make(source, true, &p.order, error));
  find_steps(&p);
  json_auto_t *description = describe(&p);
  char *text = json_dumps(description, JSON_COMPACT);
  json_auto_t *data = json_pack("{s:O, s:s, s:b}", "title", json_object_get(description, "title"),
                                "basis", text, "live", (int)shown->live);
  const supine_template page_template = {supine_export_assets, data, write_tensors, &p};
  supine_template_fill(&page_template, "page.html", file);
  free(text);
  return status == SUPINE_OK ? status : supine_error_set(error, status, "out of memory");
}

supine_status supine_export_html_write(const char *path, const export_source *source,
                                       const export_page *shown, supine_error *error) {
  SUPINE_FREED_BY(supine_output_abandon) supine_output output = {0};
  SUPINE_TRY(supine_output_open(path, &output, error));
  SUPINE_TRY(supine_export_html_print(output.file, source, shown, error));
  return supine_output_commit(&output, error);
}
