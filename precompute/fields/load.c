/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Read another simulator's displacement fields, and match its points to the vertices. */
#include <math.h>
#include <stdlib.h>

#include <supine/safetensors.h>

#include "base/text.h"
#include "base/vec3.h"
#include "precompute/fields/fields.h"
#include "precompute/lungs/surface.h"

/* Largest distance between unit vectors that count as the same direction. */
static const double same_direction = 1e-6;
/* Largest distance of a vertex from its point, as a fraction of the diagonal of the lungs' box. */
static const double farthest_point = 1e-4;

/* A file being read. */
typedef struct reading {
  const char *path;
  const supine_lungs *lungs;
  supine_scan_frame frame;
  const supine_tensor *points, *gravity, *displacement;
  double *at;       /* [P, 3] points, mm, LPS */
  size_t *point_of; /* [N] the point at the position of each vertex */
  supine_fields fields;
  supine_error *error;
} reading;

void supine_fields_free(supine_fields *fields) {
  free(fields->directions);
  free(fields->displacement);
  *fields = (supine_fields){0};
}

static supine_status allocate(reading *r) {
  const size_t m = r->fields.direction_count = r->gravity->shape[0];
  const size_t n = r->fields.vertex_count = r->lungs->mesh.vertex_count;
  r->at = malloc((3 * r->points->shape[0] + 1) * sizeof *r->at);
  r->point_of = malloc(n * sizeof *r->point_of);
  r->fields.directions = malloc(3 * m * sizeof *r->fields.directions);
  r->fields.displacement = malloc(3 * m * n * sizeof *r->fields.displacement);
  return r->at != NULL && r->point_of != NULL && r->fields.directions != NULL &&
                 r->fields.displacement != NULL
             ? SUPINE_OK
             : supine_error_set(r->error, SUPINE_ERROR_MEMORY,
                                "no memory for %zu fields of %zu vertices", m, n);
}

/* Read row `row` of a tensor [..., 3], converted to LPS and times `scale`. Return whether it is
 * finite. */
static bool read_row(const reading *r, const supine_tensor *tensor, size_t row, double scale,
                     double out[3]) {
  for (size_t k = 0; k < 3; ++k) {
    out[k] = tensor->dtype == SUPINE_F64 ? ((const double *)tensor->data)[3 * row + k]
                                         : (double)((const float *)tensor->data)[3 * row + k];
  }
  supine_mesh_axes_apply(r->frame.axes, scale, out);
  return isfinite(out[0]) && isfinite(out[1]) && isfinite(out[2]);
}

/* Read direction of gravity `row`, and normalise it. Refuse a repeated direction: when held out, it
 * would be predicted from its duplicate, and the leave-one-out error would be too small. */
static supine_status read_direction(const reading *r, size_t row) {
  double *g = r->fields.directions + 3 * row;
  double given[3];
  if (!read_row(r, r->gravity, row, 1.0, given) || !supine_normalise(given, g)) {
    return supine_error_set(r->error, SUPINE_ERROR_FORMAT,
                            "%s: row %zu: gravity %g,%g,%g has no direction: give a vector that is "
                            "finite and not 0",
                            r->path, row, given[0], given[1], given[2]);
  }
  for (size_t earlier = 0; earlier < row; ++earlier) {
    if (supine_distance(g, r->fields.directions + 3 * earlier) < same_direction) {
      return supine_error_set(r->error, SUPINE_ERROR_FORMAT,
                              "%s: rows %zu and %zu have the same direction of gravity: keep one "
                              "of them",
                              r->path, earlier, row);
    }
  }
  return SUPINE_OK;
}

static supine_status refuse_vertex(const reading *r, size_t vertex, double limit) {
  const double *v = r->lungs->mesh.vertices + 3 * vertex;
  double low[3];
  double high[3];
  const supine_mesh points = {.vertex_count = r->points->shape[0], .vertices = r->at};
  supine_mesh_box(&points, low, high);
  return supine_error_set(
      r->error, SUPINE_ERROR_MESH,
      "%s: the vertex at %.3f,%.3f,%.3f mm (LPS) has no point of its own within %.2g mm. The "
      "points span %.0f to %.0f, %.0f to %.0f and %.0f to %.0f mm: give the surface and the points "
      "in the same axes and unit, and a point for each vertex",
      r->path, v[0], v[1], v[2], limit, low[0], high[0], low[1], high[1], low[2], high[2]);
}

/* Find the point at the position of each vertex. Each point belongs to the vertex nearest to it, so
 * that no two vertices share a point. Points far from all vertices, such as inner nodes of a
 * volume mesh, are left out. */
static supine_status match(const reading *r, const supine_inside_surface *vertices,
                           double *distance) {
  const supine_lungs *lungs = r->lungs;
  const size_t n = lungs->mesh.vertex_count;
  const double limit = farthest_point * supine_distance(lungs->minimum, lungs->maximum);
  for (size_t i = 0; i < n; ++i) {
    distance[i] = INFINITY;
  }
  for (size_t p = 0; p < r->points->shape[0]; ++p) {
    const supine_inside_place place = supine_inside_surface_nearest(vertices, r->at + 3 * p, NULL);
    const size_t i = place.triangle;
    if (place.depth <= limit && fabs(place.depth - distance[i]) <= 1e-3 * limit) {
      return supine_error_set(r->error, SUPINE_ERROR_MESH,
                              "%s: points %zu and %zu are at the same place: keep the one that "
                              "belongs to the lungs",
                              r->path, r->point_of[i], p);
    }
    if (place.depth <= limit && place.depth < distance[i]) {
      distance[i] = place.depth;
      r->point_of[i] = p;
    }
  }
  for (size_t i = 0; i < n; ++i) {
    if (isinf(distance[i])) {
      return refuse_vertex(r, i, limit);
    }
  }
  return SUPINE_OK;
}

/* Read the points, and match them to the vertices by a search tree over triangles whose three
 * corners are the same vertex. */
static supine_status match_points(const reading *r) {
  const size_t n = r->lungs->mesh.vertex_count;
  supine_inside_surface *tree = NULL;
  double *distance = malloc(n * sizeof *distance);
  uint32_t *corners = malloc(3 * n * sizeof *corners);
  supine_status status = SUPINE_OK;
  for (size_t p = 0; p < r->points->shape[0] && status == SUPINE_OK; ++p) {
    if (!read_row(r, r->points, p, r->frame.millimetres_per_unit, r->at + 3 * p)) {
      status = supine_error_set(r->error, SUPINE_ERROR_FORMAT,
                                "%s: point %zu is not finite: correct it", r->path, p);
    }
  }
  if (distance == NULL || corners == NULL) {
    status = supine_error_set(r->error, SUPINE_ERROR_MEMORY, "no memory for %zu vertices", n);
  }
  for (size_t i = 0; i < 3 * n && status == SUPINE_OK; ++i) {
    corners[i] = (uint32_t)(i / 3);
  }
  if (status == SUPINE_OK) {
    status =
        supine_inside_surface_create(r->lungs->mesh.vertices, n, corners, false, &tree, r->error);
  }
  if (status == SUPINE_OK) {
    status = match(r, tree, distance);
  }
  supine_inside_surface_destroy(tree);
  free(corners);
  free(distance);
  return status;
}

/* Read the displacement of each vertex for one direction of gravity. */
static supine_status read_field(const reading *r, size_t row) {
  const size_t n = r->fields.vertex_count;
  for (size_t i = 0; i < n; ++i) {
    if (!read_row(r, r->displacement, row * r->points->shape[0] + r->point_of[i],
                  r->frame.millimetres_per_unit, r->fields.displacement + 3 * (n * row + i))) {
      return supine_error_set(r->error, SUPINE_ERROR_FORMAT,
                              "%s: row %zu: the displacement of point %zu is not finite: correct "
                              "it",
                              r->path, row, r->point_of[i]);
    }
  }
  return SUPINE_OK;
}

static bool is_real(const supine_tensor *tensor, size_t rank) {
  return tensor != NULL && tensor->rank == rank && tensor->shape[rank - 1] == 3 &&
         (tensor->dtype == SUPINE_F32 || tensor->dtype == SUPINE_F64);
}

static supine_status check_tensors(const reading *r) {
  const supine_tensor *u = r->displacement;
  if (!is_real(r->gravity, 2) || !is_real(u, 3) || r->gravity->shape[0] != u->shape[0] ||
      r->gravity->shape[0] == 0) {
    return supine_error_set(r->error, SUPINE_ERROR_FORMAT,
                            "%s: expected tensors points [P,3], gravity [M,3] and displacement "
                            "[M,P,3], F32 or F64: write all three",
                            r->path);
  }
  return is_real(r->points, 2) && r->points->shape[0] == u->shape[1]
             ? SUPINE_OK
             : supine_error_set(
                   r->error, SUPINE_ERROR_FORMAT,
                   "%s: the tensor points [%zu,3] is missing or has another shape: it gives the "
                   "position of each point that the displacements belong to. In Python: t = "
                   "safetensors.numpy.load_file(\"%s\"); supine.save_fields(\"%s\", points, "
                   "t[\"gravity\"], t[\"displacement\"])",
                   r->path, u->shape[1], r->path, r->path);
}

static supine_status take_tensors(reading *r) {
  supine_status status = check_tensors(r);
  status = status == SUPINE_OK ? allocate(r) : status;
  for (size_t d = 0; d < r->fields.direction_count && status == SUPINE_OK; ++d) {
    status = read_direction(r, d);
  }
  status = status == SUPINE_OK ? match_points(r) : status;
  for (size_t d = 0; d < r->fields.direction_count && status == SUPINE_OK; ++d) {
    status = read_field(r, d);
  }
  return status;
}

supine_status supine_fields_load(const char *path, const supine_lungs *lungs,
                                 const supine_scan_frame *frame, supine_fields *fields,
                                 supine_error *error) {
  reading r = {.path = path, .lungs = lungs, .frame = *frame, .error = error};
  r.frame.millimetres_per_unit += r.frame.millimetres_per_unit == 0.0;
  supine_safetensors *file = NULL;
  supine_status status = supine_safetensors_open(path, &file, error);
  if (status == SUPINE_OK) {
    r.points = supine_safetensors_find(file, "points");
    r.gravity = supine_safetensors_find(file, "gravity");
    r.displacement = supine_safetensors_find(file, "displacement");
    status = take_tensors(&r);
  }
  supine_safetensors_close(file);
  free(r.at);
  free(r.point_of);
  if (status != SUPINE_OK) {
    supine_fields_free(&r.fields);
    return status;
  }
  *fields = r.fields;
  return SUPINE_OK;
}
