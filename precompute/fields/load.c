/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Read another simulator's displacement fields, and match its points to the vertices. */
#include <math.h>
#include <stdlib.h>

#include <supine/inputs.h>
#include <supine/safetensors.h>

#include "base/arena.h"
#include "base/text.h"
#include "base/vec3.h"
#include "precompute/fields/fields.h"
#include "precompute/lungs/surface.h"

/* Largest distance of a vertex from its point, as a fraction of the diagonal of the lungs' box. */
static const double farthest_point = 1e-4;

#define WRITE "supine.save_fields(\"fields.safetensors\", points, gravity, displacement)"

/* A file being read. */
typedef struct reading {
  const char *path;
  supine_safetensors *file;
  const supine_lungs *lungs;
  supine_scan_frame frame;
  const supine_tensor *points, *gravity, *displacement;
  const supine_tensor *run; /* number of the run of each row of displacement; NULL for the rows of
                               gravity */
  size_t *gravity_row;      /* [M] row of gravity of each row of displacement */
  size_t *point_of;         /* [N] the point at the position of each vertex */
  double *apart;            /* [N] distance of each vertex from this point, mm */
  uint32_t *corner;         /* [N, 3] the number of each vertex, three times */
  supine_fields fields;
  supine_error *error;
  supine_arena arena;
} reading;

void supine_fields_free(supine_fields *fields) {
  free(fields->directions);
  free(fields->displacement);
  *fields = (supine_fields){0};
}

static supine_status allocate(reading *r) {
  const size_t m = r->fields.run_count = r->displacement->shape[0];
  const size_t n = r->fields.vertex_count = r->lungs->mesh.vertex_count;
  r->point_of = supine_arena_take(&r->arena, n, sizeof *r->point_of);
  r->apart = supine_arena_take(&r->arena, n, sizeof *r->apart);
  r->gravity_row = supine_arena_take(&r->arena, m, sizeof *r->gravity_row);
  r->corner = supine_arena_take(&r->arena, 3 * n, sizeof *r->corner);
  r->fields.directions = malloc(3 * m * sizeof *r->fields.directions);
  r->fields.displacement = malloc(3 * m * n * sizeof *r->fields.displacement);
  return r->arena.failed || r->fields.directions == NULL || r->fields.displacement == NULL
             ? supine_error_memory(r->error, "%zu fields of %zu vertices", m, n)
             : SUPINE_OK;
}

static double number_at(const supine_tensor *tensor, size_t i) {
  return tensor->dtype == SUPINE_F64 ? ((const double *)tensor->data)[i]
                                     : (double)((const float *)tensor->data)[i];
}

/* Read the first three numbers of row `row` of a tensor [..., 3 or 4], converted to LPS and times
 * `scale`. Return whether they are finite. */
static bool read_row(const reading *r, const supine_tensor *tensor, size_t row, double scale,
                     double out[3]) {
  const size_t width = tensor->shape[tensor->rank - 1];
  for (size_t k = 0; k < 3; ++k) {
    out[k] = number_at(tensor, width * row + k);
  }
  supine_mesh_axes_apply(r->frame.axes, scale, out);
  return isfinite(out[0]) && isfinite(out[1]) && isfinite(out[2]);
}

/* Return the number of the run of a row of gravity: its fourth column, or the row. */
static double run_of(const reading *r, size_t row) {
  return r->gravity->shape[1] == 4 ? number_at(r->gravity, 4 * row + 3) : (double)row;
}

/* Find the row of gravity of a row of displacement: the row of the same run. */
static supine_status match_run(const reading *r, size_t d) {
  const size_t rows = r->gravity->shape[0];
  const double wanted = number_at(r->run, d);
  size_t found = rows;
  for (size_t row = 0; row < rows; ++row) {
    if (run_of(r, row) == wanted) {
      SUPINE_REFUSE_IF(found < rows, r->error, SUPINE_ERROR_FORMAT,
                       "%s: rows %zu and %zu of gravity are both of run %g: number each run once",
                       r->path, found, row, wanted);
      found = row;
    }
  }
  SUPINE_REFUSE_IF(found == rows, r->error, SUPINE_ERROR_FORMAT,
                   "%s: row %zu of displacement is of run %g, but gravity has no such run: give "
                   "the column 'run' of the plan with both",
                   r->path, d, wanted);
  r->gravity_row[d] = found;
  return SUPINE_OK;
}

/* Find the rows of gravity of all rows of displacement, which have the same order without runs. */
static supine_status match_runs(const reading *r) {
  for (size_t d = 0; d < r->fields.run_count; ++d) {
    r->gravity_row[d] = d;
    if (r->run != NULL) {
      SUPINE_TRY(match_run(r, d));
    }
  }
  return SUPINE_OK;
}

/* Read the direction of gravity of run `d`, and normalise it.
 * @param length  written: its length before */
static supine_status read_direction(const reading *r, size_t d, double *length) {
  double *g = r->fields.directions + 3 * d;
  const size_t row = r->gravity_row[d];
  double given[3];
  const bool good = read_row(r, r->gravity, row, 1.0, given) && supine_normalise(given, g);
  SUPINE_REFUSE_IF(
      !good, r->error, SUPINE_ERROR_FORMAT,
      "%s: row %zu: gravity %g,%g,%g has no direction: give a vector that is finite and not 0",
      r->path, row, given[0], given[1], given[2]);
  *length = supine_length(given);
  return SUPINE_OK;
}

/* Read the directions of gravity. Its strength must be the same in all runs. */
static supine_status read_directions(const reading *r) {
  double range[2] = {INFINITY, 0.0}; /* smallest and largest length */
  size_t row[2] = {0, 0};
  SUPINE_TRY(match_runs(r));
  for (size_t d = 0; d < r->fields.run_count; ++d) {
    double length = 0.0;
    SUPINE_TRY(read_direction(r, d, &length));
    if (length < range[0]) {
      range[0] = length;
      row[0] = r->gravity_row[d];
    }
    if (length > range[1]) {
      range[1] = length;
      row[1] = r->gravity_row[d];
    }
  }
  const supine_input_verdict verdict =
      supine_input_judge(SUPINE_INPUT_FIELDS_GRAVITY, range[1] / range[0]);
  SUPINE_REFUSE_IF(
      verdict == SUPINE_INPUT_REFUSED, r->error, SUPINE_ERROR_FORMAT,
      "%s: gravity has length %.3g in row %zu and %.3g in row %zu: its strength must be "
      "the same in all rows. Leave out load steps before the last, and give each run "
      "with the whole of gravity",
      r->path, range[0], row[0], range[1], row[1]);
  return SUPINE_OK;
}

/* Match point p to the vertex nearest to it, unless that is far away or has a nearer point. */
static supine_status match_point(const reading *r, const supine_lungs_surface *vertices,
                                 double limit, size_t p) {
  double at[3];
  const bool good = read_row(r, r->points, p, r->frame.millimetres_per_unit, at);
  SUPINE_REFUSE_IF(!good, r->error, SUPINE_ERROR_FORMAT, "%s: point %zu is not finite: correct it",
                   r->path, p);
  const supine_inside_place place = supine_lungs_surface_nearest(vertices, at, NULL);
  const size_t i = place.triangle;
  SUPINE_REFUSE_IF(
      place.depth <= limit && fabs(place.depth - r->apart[i]) <= 1e-3 * limit, r->error,
      SUPINE_ERROR_MESH,
      "%s: points %zu and %zu are at the same place: keep the one that belongs to the lungs",
      r->path, r->point_of[i], p);
  if (place.depth <= limit && place.depth < r->apart[i]) {
    r->apart[i] = place.depth;
    r->point_of[i] = p;
  }
  return SUPINE_OK;
}

/* Find the point at the position of each vertex. A point belongs only to the vertex nearest to it,
 * so that no two vertices share a point. The search tree is that of triangles whose three corners
 * are one vertex. */
static supine_status match_points(const reading *r) {
  const supine_lungs *lungs = r->lungs;
  const size_t n = lungs->mesh.vertex_count;
  const double limit = farthest_point * supine_distance(lungs->minimum, lungs->maximum);
  SUPINE_FREED_BY(supine_lungs_surface_drop) supine_lungs_surface *tree = NULL;
  for (size_t i = 0; i < n; ++i) {
    r->apart[i] = INFINITY;
    r->corner[3 * i] = r->corner[3 * i + 1] = r->corner[3 * i + 2] = (uint32_t)i;
  }
  SUPINE_TRY(
      supine_lungs_surface_create(lungs->mesh.vertices, n, r->corner, false, &tree, r->error));
  for (size_t p = 0; p < r->points->shape[0]; ++p) {
    SUPINE_TRY(match_point(r, tree, limit, p));
  }
  for (size_t i = 0; i < n; ++i) {
    const double *v = lungs->mesh.vertices + 3 * i;
    SUPINE_REFUSE_IF(
        isinf(r->apart[i]), r->error, SUPINE_ERROR_MESH,
        "%s: the vertex at %.3f,%.3f,%.3f mm (LPS) has no point of its own within %.2g mm: give a "
        "point for each vertex of the surface, in the axes and unit of its file",
        r->path, v[0], v[1], v[2], limit);
  }
  return SUPINE_OK;
}

/* Read the displacement of each vertex for one direction of gravity. */
static supine_status read_field(const reading *r, size_t row) {
  const size_t n = r->fields.vertex_count;
  for (size_t i = 0; i < n; ++i) {
    const bool good =
        read_row(r, r->displacement, row * r->points->shape[0] + r->point_of[i],
                 r->frame.millimetres_per_unit, r->fields.displacement + 3 * (n * row + i));
    SUPINE_REFUSE_IF(!good, r->error, SUPINE_ERROR_FORMAT,
                     "%s: row %zu: the displacement of point %zu is not finite: correct it",
                     r->path, row, r->point_of[i]);
  }
  return SUPINE_OK;
}

static bool is_real(const supine_tensor *tensor, size_t rank) {
  return tensor != NULL && tensor->rank == rank &&
         (tensor->dtype == SUPINE_F32 || tensor->dtype == SUPINE_F64);
}

/* Return whether a tensor holds vectors: its last dimension is 3. */
static bool is_vectors(const supine_tensor *tensor, size_t rank) {
  return is_real(tensor, rank) && tensor->shape[rank - 1] == 3;
}

static supine_status check_tensors(const reading *r) {
  const supine_tensor *u = r->displacement;
  const bool valid = is_vectors(r->points, 2) && is_real(r->gravity, 2) && is_vectors(u, 3) &&
                     (r->gravity->shape[1] == 3 || r->gravity->shape[1] == 4) &&
                     (r->run != NULL || r->gravity->shape[0] == u->shape[0]) &&
                     r->points->shape[0] == u->shape[1] && u->shape[0] > 0;
  const bool numbered = r->run == NULL || (is_real(r->run, 1) && r->run->shape[0] == u->shape[0]);
  SUPINE_REFUSE_IF(
      !valid, r->error, SUPINE_ERROR_FORMAT,
      "%s: expected tensors points [P,3], gravity [M,3] and displacement [M,P,3], F32 or F64. "
      "Write all three, with the position of each point that is displaced, in Python: " WRITE,
      r->path);
  SUPINE_REFUSE_IF(!numbered, r->error, SUPINE_ERROR_FORMAT,
                   "%s: expected the tensor run [M], F32 or F64: the number of the run of each row "
                   "of displacement",
                   r->path);
  return SUPINE_OK;
}

static supine_status take_tensors(reading *r) {
  SUPINE_TRY(check_tensors(r));
  SUPINE_TRY(allocate(r));
  SUPINE_TRY(read_directions(r));
  SUPINE_TRY(match_points(r));
  for (size_t d = 0; d < r->fields.run_count; ++d) {
    SUPINE_TRY(read_field(r, d));
  }
  return SUPINE_OK;
}

static void close(reading *r) {
  supine_safetensors_close(r->file);
  supine_arena_free(&r->arena);
  supine_fields_free(&r->fields);
}

supine_status supine_fields_load(const char *path, const supine_lungs *lungs,
                                 const supine_scan_frame *frame, supine_fields *fields,
                                 supine_error *error) {
  SUPINE_FREED_BY(close)
  reading r = {.path = path, .lungs = lungs, .frame = *frame, .error = error};
  r.frame.millimetres_per_unit += r.frame.millimetres_per_unit == 0.0;
  const supine_status status = supine_safetensors_open(path, &r.file, error);
  SUPINE_REFUSE_IF(status == SUPINE_ERROR_FORMAT && !supine_text_ends_in(path, ".safetensors"),
                   error, status,
                   "%s: no safetensors file: convert the results of another program, such as .frd "
                   "or .dat of CalculiX or .xplt of FEBio, in Python with " WRITE,
                   path);
  SUPINE_TRY(status);
  r.points = supine_safetensors_find(r.file, "points");
  r.gravity = supine_safetensors_find(r.file, "gravity");
  r.displacement = supine_safetensors_find(r.file, "displacement");
  r.run = supine_safetensors_find(r.file, "run");
  SUPINE_TRY(take_tensors(&r));
  *fields = r.fields;
  r.fields = (supine_fields){0};
  return SUPINE_OK;
}
