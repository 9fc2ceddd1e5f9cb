/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Write the HTML page: fill page.html with scripts, shaders and the data of the basis. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"
#include "base/locale.h"

#include "program/options/facts.h"
#include "program/view/export/export.h"
#include "program/view/export/packed.h"
#include "program/view/export/template.h"
#include "program/view/render/render.h"

extern const supine_asset supine_export_assets[]; /* the files of program/view/page */

/* Quantisation step of the errors of vertices, mm. */
static const double error_step = 0.002;

enum { STORED_MAX = 32767, MODES_MAX = 128 /* meshoptimizer compresses rows of up to 256 bytes */ };

/* Tensors of 64-bit floats that the basis of the surface and that of the structures inside it have
 * in common. */
static const char *const shared[] = {
    "modes",        "volume_linear", "volume_quadratic", "volume_cubic",     "resting_volume",
    "volume_range", "full_volume",   "simulated_range",  "simulated_limits", "simulated_shares",
    "lungs_hilum"};

/* State while a page is printed. The page stores positions and coefficients as 16-bit integers,
 * which the browser multiplies by a quantisation step. */
typedef struct page {
  const supine_basis *basis;
  const supine_basis_info *info;   /* of `basis` */
  const supine_basis_info *inside; /* of the structures inside the lungs; NULL if there are none */
  const export_page *shown;
  double middle[3];        /* origin of stored positions, mm: centre of the bounding box */
  double position_step;    /* quantisation step of positions, mm */
  double coefficient_step; /* quantisation step of the surface's displacements by modes, mm */
  double inside_step;      /* the same for structures inside the lungs, mm */
  export_order order;      /* order of stored vertices and triangles of the surface */
  json_t *tensors;         /* list of objects {name, base64} for the tag {{tensors}} of page.html */
  supine_arena arena;
} page;

/* Return SUPINE_ERROR_MEMORY if memory has run out, also before, so that `bytes` is NULL. */
static supine_status add_tensor(page *p, const char *name, const void *bytes, size_t size) {
  json_t *text = bytes != NULL ? supine_export_template_base64(bytes, size) : NULL;
  return json_array_append_new(p->tensors, json_pack("{s:s, s:o}", "name", name, "base64", text)) ==
                 0
             ? SUPINE_OK
             : SUPINE_ERROR_MEMORY;
}

static int16_t quantise(double value, double step) {
  return (int16_t)lrint(value / step);
}

static double length_of(const float v[3]) {
  return hypot(hypot((double)v[0], (double)v[1]), (double)v[2]);
}

static void place_row(const page *p, const supine_basis_info *info, size_t vertex, size_t axis,
                      int16_t *row) {
  for (; axis < 3; ++axis) {
    row[axis] =
        quantise((double)info->vertices[3 * vertex + axis] - p->middle[axis], p->position_step);
  }
}

static void direction_row(const page *p, const supine_basis_info *info, size_t vertex, size_t axis,
                          int16_t *row) {
  static const float none[3] = {0, 0, 1};
  const float *d = info->direction + 3 * vertex;
  const float length = (float)length_of(d);
  const float unit[3] = {d[0] / length, d[1] / length, d[2] / length};
  (void)p;
  (void)axis;
  supine_export_pack_direction(length > 0 ? unit : none, 4 * sizeof *row, row);
}

/* Return the length of the vector that multiplies the coefficients of a vertex, mm. */
static double reach_of(const supine_basis_info *info, size_t vertex) {
  return info->vector ? 1 : length_of(info->direction + 3 * vertex);
}

/* Return the number of coefficients of a vertex for each mode. */
static size_t axes_of(const supine_basis_info *info) {
  return info->vector ? 3 : 1;
}

static void coefficient_row(const page *p, const supine_basis_info *info, size_t vertex,
                            size_t axis, int16_t *row) {
  const size_t k = info->mode_count;
  const float *from = info->coefficients + (vertex * axes_of(info) + axis) * k;
  const double step = info == p->info ? p->coefficient_step : p->inside_step;
  for (size_t i = 0; i < k; ++i) {
    row[i] = quantise((double)from[i] * reach_of(info, vertex), step);
  }
}

/* Write the scalars and the cluster of a vertex, which fit 16 bits as they are. */
static void cluster_row(const page *p, const supine_basis_info *info, size_t vertex, size_t axis,
                        int16_t *row) {
  (void)p;
  (void)axis;
  row[0] = info->cluster_scalars[2 * vertex];
  row[1] = info->cluster_scalars[2 * vertex + 1];
  row[2] = (int16_t)info->cluster[vertex];
}

/* Write the error of a fit to another simulator's fields, in steps of `error_step`. */
static void error_row(const page *p, const supine_basis_info *info, size_t vertex, size_t axis,
                      int16_t *row) {
  const float *errors = supine_basis_tensor(p->basis, "error_vertices")->data;
  (void)info;
  (void)axis;
  row[0] = quantise(fmin((double)errors[vertex], STORED_MAX * error_step), error_step);
}

typedef void fill_row(const page *p, const supine_basis_info *info, size_t vertex, size_t axis,
                      int16_t *row);

/* Compress and add integers of all vertices of a basis, [axes, vertices, columns]. `fill` computes
 * the columns of a vertex on an axis; they are padded to an even number. */
static supine_status add_rows(page *p, const char *name, const supine_basis_info *info, size_t axes,
                              size_t columns, fill_row *fill) {
  const size_t n = info == p->info ? p->order.vertex_count : info->vertex_count;
  const size_t stride = (columns + 1) / 2 * 2;
  size_t size = 0;
  SUPINE_ARENA arena = {0};
  int16_t *rows = supine_arena_zeros(&arena, axes * n, stride * sizeof *rows);
  if (rows == NULL) {
    return SUPINE_ERROR_MEMORY;
  }
  for (size_t i = 0; i < axes * n; ++i) {
    fill(p, info, info == p->info ? p->order.vertex[i % n] : i % n, i / n, rows + i * stride);
  }
  const void *packed =
      supine_export_pack_rows(&arena, rows, axes * n, stride * sizeof *rows, &size);
  return add_tensor(p, name, packed, size);
}

/* Add what moves vertices in clusters: a row for each vertex, and the vectors of each cluster. */
static supine_status add_clusters(page *p) {
  const supine_basis_info *info = p->info;
  const size_t numbers = info->cluster_count * info->mode_count * SUPINE_CLUSTER_NUMBERS;
  SUPINE_TRY(add_rows(p, "clusters", info, 1, 3, cluster_row));
  return add_tensor(p, "cluster_vectors", info->cluster_vectors, numbers * sizeof(float));
}

static supine_status add_corners(page *p, const char *name, const uint32_t *corners, size_t count,
                                 size_t vertices) {
  size_t size = 0;
  SUPINE_ARENA arena = {0};
  const void *packed = supine_export_pack_corners(&arena, corners, count, vertices, &size);
  return add_tensor(p, name, packed, size);
}

/* Return the largest displacement of a vertex along an axis by one mode, mm. */
static double largest_coefficient(const supine_basis_info *info) {
  const size_t columns = axes_of(info) * info->mode_count;
  double largest = 0;
  for (size_t i = 0; i < info->vertex_count * columns; ++i) {
    largest = fmax(largest, fabs((double)info->coefficients[i]) * reach_of(info, i / columns));
  }
  return largest;
}

/* Choose the origin of positions and the quantisation steps. Positions then err by at most 0.02 mm,
 * unless larger steps are needed to keep the stored integers below STORED_MAX. */
static void find_steps(page *p) {
  static const double step = 0.005;
  const supine_basis_info *inside = p->inside;
  const double least = 2 * step / (double)p->info->mode_count;
  double low[3] = {INFINITY, INFINITY, INFINITY};
  double high[3] = {-INFINITY, -INFINITY, -INFINITY};
  supine_render_box(p->info->vertices, p->info->vertex_count, low, high);
  if (inside != NULL) {
    supine_render_box(inside->vertices, inside->vertex_count, low, high);
  }
  p->position_step = step;
  for (size_t axis = 0; axis < 3; ++axis) {
    p->middle[axis] = (low[axis] + high[axis]) / 2;
    p->position_step = fmax(p->position_step, (high[axis] - low[axis]) / (2 * STORED_MAX));
  }
  p->coefficient_step = 1;
  p->inside_step = 1;
  if (p->info->cluster_count == 0) {
    p->coefficient_step = fmax(least, largest_coefficient(p->info) / STORED_MAX);
  }
  if (inside != NULL) {
    p->inside_step = fmax(least, largest_coefficient(inside) / STORED_MAX);
  }
}

/* Add a tensor of 64-bit floats, uncompressed, as the page's tensor `name`. */
static supine_status add_doubles(page *p, const char *name, const supine_tensor *tensor) {
  size_t bytes = sizeof(double);
  for (size_t axis = 0; axis < tensor->rank; ++axis) {
    bytes *= tensor->shape[axis];
  }
  return add_tensor(p, name, tensor->data, bytes);
}

/* Add the tensors that the surface shares with the structures inside it, such as modes and volume
 * coefficients. */
static supine_status add_shared(page *p) {
  for (size_t i = 0; i < sizeof shared / sizeof *shared; ++i) {
    const supine_tensor *tensor = supine_basis_tensor(p->basis, shared[i]);
    if (tensor != NULL) {
      SUPINE_TRY(add_doubles(p, shared[i], tensor));
    }
  }
  return SUPINE_OK;
}

/* Add the sums and the box from which the library computes the expected errors of a simplified
 * surface: those of the whole one. */
static supine_status add_squares(page *p) {
  const supine_basis_info *info = p->info;
  const size_t count = 3 * info->lung_count * info->mode_count * info->mode_count;
  double box[2][3] = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
  SUPINE_ARENA arena = {0};
  double *squares = supine_arena_take(&arena, count, sizeof *squares);
  if (squares == NULL) {
    return SUPINE_ERROR_MEMORY;
  }
  supine_export_squares(p->basis, squares);
  supine_render_box(info->vertices, info->vertex_count, box[0], box[1]);
  SUPINE_TRY(add_tensor(p, "lungs_box", box, sizeof box));
  return add_tensor(p, "lungs_squares", squares, count * sizeof *squares);
}

/* Return the 256 colours of each colour map as hexadecimal digits. */
static json_t *colours(void) {
  static const char *const names[SUPINE_COLOURS_COUNT] = {"displacement", "difference"};
  enum { COLOURS = 256 };
  json_t *maps = json_object();
  for (supine_colours map = 0; map < SUPINE_COLOURS_COUNT; ++map) {
    char text[6 * COLOURS + 1];
    for (int i = 0; i < COLOURS; ++i) {
      supine_render_hex(map, i / (double)(COLOURS - 1), text + 6 * i);
    }
    (void)json_object_set_new(maps, names[map], json_string(text));
  }
  return maps;
}

/* Return `begin` as a JSON list: the first index of each lung, then the end of the last lung. */
static json_t *begins(const supine_basis_info *info, const size_t *begin) {
  json_t *list = json_array();
  for (size_t i = 0; i <= info->lung_count; ++i) {
    (void)json_array_append_new(list, json_integer((json_int_t)begin[i]));
  }
  return list;
}

/* Describe the structures inside the lungs as JSON: sizes, names and quantisation step. */
static json_t *describe_inside(const page *p) {
  const supine_basis_info *info = p->inside;
  if (info == NULL) {
    return json_null();
  }
  json_t *names = json_array();
  json_t *anatomy = json_array();
  for (size_t i = 0; i < p->shown->names->count; ++i) {
    (void)json_array_append_new(names, supine_options_json_text(p->shown->names->text[i]));
    if (p->shown->names->anatomy[i] != 0) {
      (void)json_array_append_new(anatomy, json_integer((json_int_t)i));
    }
  }
  const supine_tensor *rigid = supine_basis_tensor(p->shown->inside, "rigid");
  json_t *ranges = json_array();
  const uint32_t *vertex = rigid != NULL ? rigid->data : NULL;
  const size_t ends = rigid != NULL ? 2 * rigid->shape[0] : 0;
  for (size_t i = 0; i < ends; ++i) {
    (void)json_array_append_new(ranges, json_integer((json_int_t)vertex[i]));
  }
  return json_pack("{s:I, s:I, s:o, s:o, s:o, s:o, s:f, s:o}", "vertices",
                   (json_int_t)info->vertex_count, "triangles", (json_int_t)info->triangle_count,
                   "lungBegin", begins(info, info->lung_begin), "names", names, "rigidRanges",
                   ranges, "anatomy", anatomy, "unit", p->inside_step, "metadata",
                   supine_options_json_metadata(p->shown->inside));
}

/* Return the states from which displacements can be measured, as JSON: the text of a state, or null
 * for the scan. */
static json_t *describe_froms(const page *p) {
  json_t *list = json_array();
  for (size_t i = 0; i < p->shown->from_count; ++i) {
    const supine_options_reference_pose *from = &p->shown->from[i];
    char state[160];
    (void)supine_state_print(&from->state, state, sizeof state);
    (void)json_array_append_new(list,
                                json_pack("{s:s, s:o, s:o}", "name", from->name, "gravity",
                                          supine_options_json_numbers(3, from->state.gravity),
                                          "state", from->scan ? json_null() : json_string(state)));
  }
  return list;
}

/* Describe the vertices, modes and lungs of the surface as the page stores them. */
static json_t *describe_surface(const page *p) {
  const supine_basis_info *info = p->info;
  return json_pack(
      "{s:I, s:I, s:I, s:I, s:I, s:I, s:I, s:b, s:o, s:o, s:b, s:o, s:f, s:f, s:f, s:o}",
      "vertices", (json_int_t)p->order.vertex_count, "wholeVertices",
      (json_int_t)info->vertex_count, "triangles",
      (json_int_t)(p->order.corner_begin[info->lung_count] / 3), "modes",
      (json_int_t)info->mode_count, "clusters", (json_int_t)info->cluster_count, "band",
      (json_int_t)info->band, "order", (json_int_t)info->order, "vector", (int)info->vector,
      "lungBegin", begins(info, p->order.lung_begin), "cornerBegin",
      begins(info, p->order.corner_begin), "hasRest", (int)info->has_rest, "middle",
      supine_options_json_numbers(3, p->middle), "placeUnit", p->position_step, "unit",
      p->coefficient_step, "errorUnit", error_step, "references",
      supine_options_json_numbers(info->lung_count, info->reference_volume));
}

/* Return the colours of anatomy that the page takes, as pictures do. */
static json_t *anatomy_colours(void) {
  json_t *list = json_array();
  for (size_t i = 0; i < SUPINE_RENDER_TINTS; ++i) {
    (void)json_array_append_new(
        list, json_sprintf("#%06x", supine_render_palette(SUPINE_PALETTE_ANATOMY, i)));
  }
  return list;
}

/* Return the outline of the torso that the page draws, as pictures do. */
static json_t *describe_torso(void) {
  json_t *list = json_array();
  for (size_t i = 0; i < SUPINE_RENDER_SECTIONS; ++i) {
    (void)json_array_append_new(list, supine_options_json_numbers(3, supine_render_torso(i)));
  }
  return list;
}

static json_t *describe(const page *p) {
  json_t *text = describe_surface(p);
  json_t *more = json_pack(
      "{s:o, s:o, s:f, s:o, s:o, s:o, s:o, s:o}", "anatomyColours", anatomy_colours(), "colours",
      colours(), "breathVolume", p->shown->breath, "outline", describe_torso(), "metadata",
      supine_options_json_metadata(p->basis), "title", supine_options_json_text(p->shown->title),
      "inside", describe_inside(p), "froms", describe_froms(p));
  (void)json_object_update_missing(text, more);
  json_decref(more);
  return text;
}

/* Add what the library needs to know of the structures inside the lungs. */
static supine_status add_inside(page *p) {
  const supine_basis_info *inside = p->inside;
  const uint32_t *part = p->shown->names->part;
  SUPINE_TRY(add_rows(p, "inside-vertices", inside, 1, 3, place_row));
  SUPINE_TRY(add_rows(p, "inside-coefficients", inside, 3, inside->mode_count, coefficient_row));
  SUPINE_TRY(add_corners(p, "inside-triangles", inside->triangles, 3 * inside->triangle_count,
                         inside->vertex_count));
  if (supine_basis_tensor(p->shown->inside, "lungs_squares") != NULL) {
    SUPINE_TRY(add_doubles(p, "inside-lungs_squares",
                           supine_basis_tensor(p->shown->inside, "lungs_squares")));
    SUPINE_TRY(
        add_doubles(p, "inside-lungs_box", supine_basis_tensor(p->shown->inside, "lungs_box")));
  }
  return add_tensor(p, "inside-parts", part, inside->vertex_count * sizeof *part);
}

static supine_status add_tensors(page *p) {
  const supine_basis_info *info = p->info;
  SUPINE_TRY(add_rows(p, "vertices", info, 1, 3, place_row));
  if (!info->vector) {
    SUPINE_TRY(add_rows(p, "direction", info, 1, 4, direction_row));
  }
  if (info->cluster_count > 0) {
    SUPINE_TRY(add_clusters(p));
  } else {
    SUPINE_TRY(add_rows(p, "coefficients", info, axes_of(info), info->mode_count, coefficient_row));
  }
  if (info->is_fields && supine_basis_tensor(p->basis, "error_vertices") != NULL) {
    const supine_tensor *gravity = supine_basis_tensor(p->basis, "error_gravity");
    const supine_tensor *volume = supine_basis_tensor(p->basis, "error_volume");
    SUPINE_TRY(add_rows(p, "error_vertices", info, 1, 1, error_row));
    if (gravity != NULL) {
      SUPINE_TRY(add_doubles(p, "error_gravity", gravity));
    }
    if (volume != NULL) {
      SUPINE_TRY(add_doubles(p, "error_volume", volume));
    }
  }
  SUPINE_TRY(add_corners(p, "triangles", p->order.corners, p->order.corner_begin[info->lung_count],
                         p->order.vertex_count));
  SUPINE_TRY(add_shared(p));
  if (p->shown->simplify > 0) {
    SUPINE_TRY(add_squares(p));
  }
  return p->inside != NULL ? add_inside(p) : SUPINE_OK;
}

static void free_page(page *p) {
  json_decref(p->tensors);
  supine_arena_free(&p->arena);
}

supine_status supine_export_html_print(FILE *file, const supine_basis *basis,
                                       const export_page *shown, export_written *written,
                                       supine_error *error) {
  SUPINE_C_LOCALE;
  SUPINE_FREED_BY(free_page)
  page p = {.basis = basis,
            .info = supine_basis_get_info(basis),
            .inside = shown->inside != NULL ? supine_basis_get_info(shown->inside) : NULL,
            .shown = shown,
            .tensors = json_array()};
  SUPINE_REFUSE_IF(
      p.info->mode_count > MODES_MAX, error, SUPINE_ERROR_UNSUPPORTED,
      "a page shows up to %d modes, not %zu: precompute the basis with --modes %d, or export .glb",
      MODES_MAX, p.info->mode_count, MODES_MAX);
  SUPINE_TRY(supine_export_pack_begin(error));
  SUPINE_TRY(supine_export_order_make(p.info, true, shown->simplify, &p.arena, &p.order, error));
  *written = (export_written){.vertices = p.order.vertex_count};
  if (shown->simplify > 0) {
    SUPINE_TRY(
        supine_export_order_error(p.info, &p.order, &written->rms, &written->largest, error));
  }
  find_steps(&p);
  if (add_tensors(&p) != SUPINE_OK) {
    return supine_error_memory(error, "the page");
  }
  json_auto_t *description = describe(&p);
  char *text = json_dumps(description, JSON_COMPACT);
  char caveats[SUPINE_CAVEATS_SIZE];
  (void)supine_basis_caveats(basis, caveats, sizeof caveats);
  json_auto_t *data =
      json_pack("{s:O, s:s, s:s, s:O, s:b, s:O?}", "title", json_object_get(description, "title"),
                "caveats", caveats, "basis", text, "tensors", p.tensors, "live", (int)shown->live,
                "still", shown->still);
  supine_export_template_fill(supine_export_assets, data, "page.html", file);
  free(text);
  return SUPINE_OK;
}
