/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Read the fields of another simulator from a list of deformed surfaces, or from one safetensors
 * file.
 */
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

/* Largest distance between unit vectors that count as the same direction. */
static const double same_direction = 1e-6;

void supine_fields_free(supine_fields *fields) {
  free(fields->directions);
  free(fields->displacement);
  *fields = (supine_fields){0};
}

/* Allocate fields of `count` directions. */
static supine_status allocate(size_t count, supine_fields *fields, supine_error *error) {
  fields->directions = malloc((3 * count + 1) * sizeof *fields->directions);
  fields->displacement =
      malloc((3 * count * fields->vertex_count + 1) * sizeof *fields->displacement);
  fields->direction_count = count;
  return fields->directions != NULL && fields->displacement != NULL
             ? SUPINE_OK
             : supine_error_set(error, SUPINE_ERROR_MEMORY,
                                "no memory for %zu fields of %zu vertices", count,
                                fields->vertex_count);
}

/* One line of the list. */
typedef struct listed {
  double gravity[3];
  size_t line;
  char *path; /* of the surface */
} listed;

/* Normalise direction `at`, and check that no earlier one is the same. Messages name the line of
 * the list, or if `list` is NULL, the row of the tensor. */
static supine_status check_direction(const supine_fields *fields, size_t at, const char *path,
                                     const listed *list, supine_error *error) {
  const char *unit = list != NULL ? "line" : "row";
  double *g = fields->directions + 3 * at;
  const double length = supine_length(g);
  if (!(length > 0.0) || !isfinite(length)) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "%s: %s %zu: gravity %g,%g,%g has no direction: give a vector that is "
                            "finite and not 0",
                            path, unit, list != NULL ? list[at].line : at, g[0], g[1], g[2]);
  }
  for (size_t k = 0; k < 3; ++k) {
    g[k] /= length;
  }
  for (size_t other = 0; other < at; ++other) {
    const double *h = fields->directions + 3 * other;
    if (supine_distance(g, h) < same_direction) {
      return supine_error_set(error, SUPINE_ERROR_FORMAT,
                              "%s: %s %zu and %zu have the same direction: keep one of them", path,
                              unit, list != NULL ? list[other].line : other,
                              list != NULL ? list[at].line : at);
    }
  }
  return SUPINE_OK;
}

/* Find the displacement of one deformed surface from the reference surface. */
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
    status = supine_error_set(
        error, SUPINE_ERROR_MESH,
        "%s: %zu vertices and %zu triangles, where the reference surface has %zu "
        "and %zu: it must be the same surface, deformed",
        path, mesh.vertex_count, mesh.triangle_count, n, rest->mesh.triangle_count);
    goto cleanup;
  }
  status = supine_lungs_create(&mesh, 1, &rest->midline, &deformed, error);
  if (status != SUPINE_OK) {
    goto cleanup;
  }
  for (size_t t = 0; t < rest->mesh.triangle_count; ++t) {
    if (memcmp(deformed.mesh.triangles + 3 * t, rest->mesh.triangles + 3 * t,
               3 * sizeof(uint32_t)) != 0) {
      status =
          supine_error_set(error, SUPINE_ERROR_MESH,
                           "%s: triangle %zu joins other vertices than the reference surface's: "
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

typedef struct surface_work {
  const listed *list;
  const supine_lungs *rest;
  const supine_mesh_load_options *options;
  supine_fields *fields;
  supine_error *errors; /* [M] */
} surface_work;

static void take_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const surface_work *work = context;
  for (size_t i = begin; i < end; ++i) {
    work->errors[i].status = take_surface(
        work->list[i].path, work->rest, work->options,
        work->fields->displacement + 3 * i * work->fields->vertex_count, &work->errors[i]);
  }
}

/* Load the surfaces of a list. Uses all cores. */
static supine_status load_surfaces(const char *path, const listed *list, size_t count,
                                   const supine_lungs *rest,
                                   const supine_mesh_load_options *options, supine_fields *fields,
                                   supine_error *error) {
  supine_error *errors = calloc(count + 1, sizeof *errors);
  supine_status status = errors == NULL
                             ? supine_error_set(error, SUPINE_ERROR_MEMORY, "%s: no memory", path)
                             : allocate(count, fields, error);
  for (size_t i = 0; i < count && status == SUPINE_OK; ++i) {
    memcpy(fields->directions + 3 * i, list[i].gravity, sizeof list[i].gravity);
    status = check_direction(fields, i, path, list, error);
  }
  if (status == SUPINE_OK) {
    surface_work work = {list, rest, options, fields, errors};
    supine_parallel_for(count, 1, 0, take_range, &work);
  }
  for (size_t i = 0; i < count && status == SUPINE_OK; ++i) {
    if (errors[i].status != SUPINE_OK) {
      status = supine_error_set(error, errors[i].status, "%s:%zu: %s", path, list[i].line,
                                errors[i].message);
    }
  }
  free(errors);
  return status;
}

/* Append one row to the list. */
static supine_status take_row(const supine_csv *csv, listed **list, size_t *count,
                              supine_error *error) {
  static const char *const names[] = {"gx", "gy", "gz"};
  listed *grown = realloc(*list, (*count + 1) * sizeof *grown);
  if (grown == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "%s: no memory", csv->path);
  }
  *list = grown;
  listed *row = &grown[*count];
  *row = (listed){.line = csv->line};
  supine_status status = SUPINE_OK;
  for (size_t k = 0; k < 3 && status == SUPINE_OK; ++k) {
    status = supine_csv_number(csv, k, names[k], &row->gravity[k], error);
  }
  if (status == SUPINE_OK) {
    row->path = supine_path_beside(csv->path, supine_csv_text(csv, 3));
    *count += row->path != NULL;
  }
  return status == SUPINE_OK && row->path == NULL
             ? supine_error_set(error, SUPINE_ERROR_MEMORY, "%s: no memory", csv->path)
             : status;
}

static supine_status load_list(const char *path, const supine_lungs *rest,
                               const supine_mesh_load_options *options, supine_fields *fields,
                               supine_error *error) {
  static const char *const columns[] = {"gx", "gy", "gz", "file"};
  supine_csv csv;
  listed *list = NULL;
  size_t count = 0;
  bool more = true;
  supine_status status = supine_csv_open(path, columns, 4, 4, &csv, error);
  if (status != SUPINE_OK) {
    return status;
  }
  while ((status = supine_csv_next(&csv, &more, error)) == SUPINE_OK && more) {
    status = take_row(&csv, &list, &count, error);
    if (status != SUPINE_OK) {
      break;
    }
  }
  supine_csv_close(&csv);
  if (status == SUPINE_OK) {
    status = load_surfaces(path, list, count, rest, options, fields, error);
  }
  for (size_t i = 0; i < count; ++i) {
    free(list[i].path);
  }
  free(list);
  return status;
}

/* Read an element of an F32 or F64 tensor. */
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
                            "%s: it must hold gravity [M,3] and displacement [M,N,3], F32 or F64: "
                            "write both",
                            path);
  }
  if (displacement->shape[1] != n) {
    return supine_error_set(
        error, SUPINE_ERROR_MESH,
        "%s: displacement of %zu vertices, where the reference surface has %zu: "
        "give one for each vertex",
        path, displacement->shape[1], n);
  }
  const size_t count = gravity->shape[0];
  const supine_axes axes = options != NULL ? options->axes : SUPINE_AXES_AUTO;
  const double unit =
      options != NULL && options->millimetres_per_unit > 0.0 ? options->millimetres_per_unit : 1.0;
  supine_status status = allocate(count, fields, error);
  for (size_t d = 0; d < count && status == SUPINE_OK; ++d) {
    for (size_t k = 0; k < 3; ++k) {
      fields->directions[3 * d + k] = element(gravity, 3 * d + k);
    }
    status = check_direction(fields, d, path, NULL, error);
    for (size_t i = 0; i < n && status == SUPINE_OK; ++i) {
      double *u = fields->displacement + 3 * (n * d + i);
      for (size_t k = 0; k < 3; ++k) {
        u[k] = element(displacement, 3 * (n * d + i) + k);
      }
      if (!isfinite(u[0]) || !isfinite(u[1]) || !isfinite(u[2])) {
        status = supine_error_set(
            error, SUPINE_ERROR_FORMAT,
            "%s: row %zu: the displacement of vertex %zu is not finite: correct it", path, d, i);
      }
      supine_mesh_axes_apply(axes, unit, u);
    }
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
    status = supine_error_set(
        error, SUPINE_ERROR_FORMAT,
        "%s: %zu direction%s: give at least two, so that one can be predicted from "
        "another",
        path, made.direction_count, made.direction_count == 1 ? "" : "s");
  }
  if (status != SUPINE_OK) {
    supine_fields_free(&made);
    return status;
  }
  *fields = made;
  return SUPINE_OK;
}
