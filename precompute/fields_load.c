/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Reading the fields of another simulator: a list of deformed surfaces, or one tensor file. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "precompute/fields.h"
#include "sh/base/parallel.h"
#include <supine/safetensors.h>

#include "sh/base/csv.h"
#include "sh/base/output.h"
#include "sh/base/text.h"
#include "sh/base/vec3.h"

/* Directions closer than this are the same, radians. */
static const double same_direction = 1e-6;

void supine_fields_free(supine_fields *fields) {
  free(fields->directions);
  free(fields->displacement);
  *fields = (supine_fields){0};
}

/* Space for `count` directions more than there are. */
static supine_status grow(supine_fields *fields, size_t count, supine_error *error) {
  const size_t total = fields->direction_count + count;
  double *directions = realloc(fields->directions, 3 * total * sizeof *directions);
  if (directions != NULL) {
    fields->directions = directions;
    double *displacement =
        realloc(fields->displacement, 3 * total * fields->vertex_count * sizeof *displacement);
    if (displacement != NULL) {
      fields->displacement = displacement;
      return SUPINE_OK;
    }
  }
  return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu fields of %zu vertices",
                          total, fields->vertex_count);
}

/* Normalises direction `at`, which `where` (a line or row) names, and looks for its like among
 * those before. */
static supine_status check_direction(const supine_fields *fields, size_t at, const char *path,
                                     const char *unit, const size_t *where, supine_error *error) {
  double *g = fields->directions + 3 * at;
  const double length = supine_length(g);
  if (!(length > 0.0) || !isfinite(length)) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "%s: %s %zu: gravity %g,%g,%g has no direction", path, unit, where[at],
                            g[0], g[1], g[2]);
  }
  for (size_t k = 0; k < 3; ++k) {
    g[k] /= length;
  }
  for (size_t other = 0; other < at; ++other) {
    const double *h = fields->directions + 3 * other;
    if (supine_distance(g, h) < same_direction) {
      return supine_error_set(error, SUPINE_ERROR_FORMAT,
                              "%s: %s %zu and %zu have the same direction: keep one of them", path,
                              unit, where[other], where[at]);
    }
  }
  return SUPINE_OK;
}

/* Displacement of one deformed surface from the rest surface. */
static supine_status take_surface(const char *path, const supine_lungs *rest,
                                  const supine_mesh_load_options *options, double *displacement,
                                  supine_error *error) {
  const size_t n = rest->mesh.vertex_count;
  supine_mesh mesh = {0};
  supine_lungs deformed = {0};
  supine_status status = supine_mesh_load(path, options, &mesh, NULL, error);
  if (status != SUPINE_OK) {
    return status;
  }
  if (mesh.vertex_count != n || mesh.triangle_count != rest->mesh.triangle_count) {
    status = supine_error_set(error, SUPINE_ERROR_MESH,
                              "%s: %zu vertices and %zu triangles, where the rest surface has %zu "
                              "and %zu: it must be the same surface, deformed",
                              path, mesh.vertex_count, mesh.triangle_count, n,
                              rest->mesh.triangle_count);
    goto cleanup;
  }
  status = supine_lungs_create(&mesh, 1, &rest->midline, &deformed, error);
  if (status != SUPINE_OK) {
    goto cleanup;
  }
  for (size_t t = 0; t < rest->mesh.triangle_count; ++t) {
    if (memcmp(deformed.mesh.triangles + 3 * t, rest->mesh.triangles + 3 * t,
               3 * sizeof(uint32_t)) != 0) {
      status = supine_error_set(error, SUPINE_ERROR_MESH,
                                "%s: triangle %zu joins other vertices than the rest surface's: "
                                "it must be the same surface, deformed",
                                path, t);
      goto cleanup;
    }
  }
  for (size_t i = 0; i < 3 * n; ++i) {
    displacement[i] = deformed.mesh.vertices[i] - rest->mesh.vertices[i];
  }
cleanup:
  supine_lungs_free(&deformed);
  supine_mesh_free(&mesh);
  return status;
}

/* The surfaces of a list, loaded on all cores once the list is read. */
typedef struct surface_work {
  char **paths;
  const supine_lungs *rest;
  const supine_mesh_load_options *options;
  supine_fields *fields;
  supine_error *errors; /* status SUPINE_OK where all went well */
} surface_work;

static void take_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const surface_work *work = context;
  for (size_t i = begin; i < end; ++i) {
    work->errors[i].status = take_surface(
        work->paths[i], work->rest, work->options,
        work->fields->displacement + 3 * i * work->fields->vertex_count, &work->errors[i]);
  }
}

static supine_status load_surfaces(const char *list, char **paths, const size_t *lines,
                                   const supine_lungs *rest,
                                   const supine_mesh_load_options *options, supine_fields *fields,
                                   supine_error *error) {
  const size_t count = fields->direction_count;
  if (count == 0) {
    return SUPINE_OK;
  }
  supine_error *errors = calloc(count, sizeof *errors);
  if (errors == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "%s: no memory", list);
  }
  surface_work work = {paths, rest, options, fields, errors};
  supine_parallel_for(count, 1, 0, take_range, &work);
  supine_status status = SUPINE_OK;
  for (size_t i = 0; i < count && status == SUPINE_OK; ++i) {
    if (errors[i].status != SUPINE_OK) {
      status = supine_error_set(error, errors[i].status, "%s:%zu: %s", list, lines[i],
                                errors[i].message);
    }
  }
  free(errors);
  return status;
}

/* One row more of a list: its direction, its line, and the path of its surface. */
static supine_status take_row(const supine_csv *csv, supine_fields *fields, char ***paths,
                              size_t **lines, supine_error *error) {
  static const char *const names[] = {"gx", "gy", "gz"};
  const size_t at = fields->direction_count;
  char **more_paths = realloc(*paths, (at + 1) * sizeof *more_paths);
  *paths = more_paths != NULL ? more_paths : *paths;
  size_t *more_lines = realloc(*lines, (at + 1) * sizeof *more_lines);
  *lines = more_lines != NULL ? more_lines : *lines;
  supine_status status = grow(fields, 1, error);
  if (status != SUPINE_OK || more_paths == NULL || more_lines == NULL ||
      fields->directions == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "%s: no memory for %zu fields", csv->path,
                            at + 1);
  }
  for (size_t k = 0; k < 3 && status == SUPINE_OK; ++k) {
    status = supine_csv_number(csv, k, names[k], fields->directions + 3 * at + k, error);
  }
  if (status != SUPINE_OK) {
    return status;
  }
  (*lines)[at] = csv->line;
  status = check_direction(fields, at, csv->path, "line", *lines, error);
  if (status != SUPINE_OK) {
    return status;
  }
  (*paths)[at] = supine_path_beside(csv->path, supine_csv_text(csv, 3));
  if ((*paths)[at] == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "%s: no memory", csv->path);
  }
  ++fields->direction_count;
  return SUPINE_OK;
}

static supine_status load_list(const char *path, const supine_lungs *rest,
                               const supine_mesh_load_options *options, supine_fields *fields,
                               supine_error *error) {
  static const char *const columns[] = {"gx", "gy", "gz", "file"};
  supine_csv csv;
  char **paths = NULL;
  size_t *lines = NULL;
  bool more = true;
  supine_status status = supine_csv_open(path, columns, 4, 4, &csv, error);
  if (status != SUPINE_OK) {
    return status;
  }
  while (status == SUPINE_OK && more) {
    status = supine_csv_next(&csv, &more, error);
    if (status == SUPINE_OK && more) {
      status = take_row(&csv, fields, &paths, &lines, error);
    }
  }
  supine_csv_close(&csv);
  if (status == SUPINE_OK) {
    status = load_surfaces(path, paths, lines, rest, options, fields, error);
  }
  for (size_t i = 0; i < fields->direction_count; ++i) {
    free(paths[i]);
  }
  free(paths);
  free(lines);
  return status;
}

/* Element of an F32 or F64 tensor. */
static double element(const supine_tensor *tensor, size_t at) {
  return tensor->dtype == SUPINE_F64 ? ((const double *)tensor->data)[at]
                                     : (double)((const float *)tensor->data)[at];
}

static bool is_real(const supine_tensor *tensor, size_t rank) {
  return tensor != NULL && tensor->rank == rank && tensor->shape[rank - 1] == 3 &&
         (tensor->dtype == SUPINE_F32 || tensor->dtype == SUPINE_F64);
}

static supine_status take_tensors(const char *path, const supine_tensor *gravity,
                                  const supine_tensor *displacement,
                                  const supine_mesh_load_options *options, supine_fields *fields,
                                  supine_error *error) {
  const size_t n = fields->vertex_count;
  if (!is_real(gravity, 2) || !is_real(displacement, 3) ||
      gravity->shape[0] != displacement->shape[0] || gravity->shape[0] == 0) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "%s: it must hold gravity [M,3] and displacement [M,N,3], F32 or F64",
                            path);
  }
  if (displacement->shape[1] != n) {
    return supine_error_set(error, SUPINE_ERROR_MESH,
                            "%s: displacement of %zu vertices, where the rest surface has %zu",
                            path, displacement->shape[1], n);
  }
  const size_t count = gravity->shape[0];
  const supine_axes axes = options != NULL ? options->axes : SUPINE_AXES_AUTO;
  const double unit =
      options != NULL && options->millimetres_per_unit > 0.0 ? options->millimetres_per_unit : 1.0;
  supine_status status = grow(fields, count, error);
  size_t *rows = malloc(count * sizeof *rows);
  if (rows == NULL || fields->directions == NULL || fields->displacement == NULL) {
    free(rows);
    (void)supine_error_set(error, SUPINE_ERROR_MEMORY, "%s: no memory for %zu fields", path, count);
    return SUPINE_ERROR_MEMORY;
  }
  for (size_t d = 0; d < count && status == SUPINE_OK; ++d) {
    rows[d] = d;
    for (size_t k = 0; k < 3; ++k) {
      fields->directions[3 * d + k] = element(gravity, 3 * d + k);
    }
    status = check_direction(fields, d, path, "row", rows, error);
    for (size_t i = 0; i < n && status == SUPINE_OK; ++i) {
      double *u = fields->displacement + 3 * (n * d + i);
      for (size_t k = 0; k < 3; ++k) {
        u[k] = element(displacement, 3 * (n * d + i) + k);
      }
      if (!isfinite(u[0]) || !isfinite(u[1]) || !isfinite(u[2])) {
        status = supine_error_set(error, SUPINE_ERROR_FORMAT,
                                  "%s: row %zu: the displacement of vertex %zu is not finite", path,
                                  d, i);
      }
      supine_mesh_axes_apply(axes, unit, u);
    }
  }
  free(rows);
  if (status == SUPINE_OK) {
    fields->direction_count = count;
  }
  return status;
}

supine_status supine_fields_load(const char *path, const supine_lungs *lungs,
                                 const supine_mesh_load_options *options, supine_fields *fields,
                                 supine_error *error) {
  supine_fields made = {.vertex_count = lungs->mesh.vertex_count};
  supine_status status = SUPINE_OK;
  if (supine_text_ends_in(path, ".safetensors")) {
    supine_safetensors *file = NULL;
    status = supine_safetensors_open(path, &file, error);
    if (status == SUPINE_OK) {
      status = take_tensors(path, supine_safetensors_find(file, "gravity"),
                            supine_safetensors_find(file, "displacement"), options, &made, error);
    }
    supine_safetensors_close(file);
  } else {
    status = load_list(path, lungs, options, &made, error);
  }
  if (status == SUPINE_OK && made.direction_count < 2) {
    status = supine_error_set(error, SUPINE_ERROR_FORMAT,
                              "%s: %zu direction: at least two are needed to know any error", path,
                              made.direction_count);
  }
  if (status != SUPINE_OK) {
    supine_fields_free(&made);
    return status;
  }
  *fields = made;
  return SUPINE_OK;
}
