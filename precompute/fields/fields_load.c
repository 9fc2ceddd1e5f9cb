/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Read another simulator's displacement fields from a safetensors file. */
#include <math.h>
#include <stdlib.h>

#include <supine/safetensors.h>

#include "base/vec3.h"
#include "precompute/fields/fields.h"

/* Largest distance between unit vectors that count as the same direction. */
static const double same_direction = 1e-6;

void supine_fields_free(supine_fields *fields) {
  free(fields->directions);
  free(fields->displacement);
  *fields = (supine_fields){0};
}

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

/* Normalise direction of gravity `at`. Refuse a repeated direction: when held out, it would be
 * predicted from its duplicate, and the leave-one-out error would be too small. */
static supine_status check_direction(const supine_fields *fields, size_t at, const char *path,
                                     supine_error *error) {
  double *g = fields->directions + 3 * at;
  const double length = supine_length(g);
  if (!(length > 0.0) || !isfinite(length)) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "%s: row %zu: gravity %g,%g,%g has no direction: give a vector that is "
                            "finite and not 0",
                            path, at, g[0], g[1], g[2]);
  }
  for (size_t k = 0; k < 3; ++k) {
    g[k] /= length;
  }
  for (size_t earlier = 0; earlier < at; ++earlier) {
    if (supine_distance(g, fields->directions + 3 * earlier) < same_direction) {
      return supine_error_set(error, SUPINE_ERROR_FORMAT,
                              "%s: rows %zu and %zu have the same direction of gravity: keep one "
                              "of them",
                              path, earlier, at);
    }
  }
  return SUPINE_OK;
}

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
    return supine_error_set(
        error, SUPINE_ERROR_FORMAT,
        "%s: expected tensors gravity [M,3] and displacement [M,N,3], F32 or F64: write both",
        path);
  }
  if (displacement->shape[1] != n) {
    return supine_error_set(
        error, SUPINE_ERROR_MESH,
        "%s: gives displacements of %zu vertices, but the reference surface has %zu vertices: give "
        "one displacement for each",
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
    status = check_direction(fields, d, path, error);
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
  supine_safetensors *file = NULL;
  supine_status status = supine_safetensors_open(path, &file, error);
  if (status == SUPINE_OK) {
    status = take_tensors(path, supine_safetensors_find(file, "gravity"),
                          supine_safetensors_find(file, "displacement"), options, &made, error);
  }
  supine_safetensors_close(file);
  if (status != SUPINE_OK) {
    supine_fields_free(&made);
    return status;
  }
  *fields = made;
  return SUPINE_OK;
}
