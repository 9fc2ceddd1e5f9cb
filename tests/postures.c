/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "tests/postures.h"

#include <math.h>
#include <stdlib.h>

#include <supine/compare.h>
#include <supine/posture.h>

#include "mesh/mesh.h"

#include "tests/poses.h"

const char *const posture_figure_names[POSTURE_COUNT] = {"supine", "prone",   "left",
                                                         "right",  "upright", "inverted"};

/* A breath is this part of the full volume: 500 mL of an adult's 7.5 L, less of smaller lungs. */
static const double breath_share = 1.0 / 15.0;
enum { QUARTERS = 4 };

/* Positions at a volume, mL beyond the file's surface, and what each lung holds beyond it. */
static supine_status place(const supine_basis *basis, const double *gravity, double volume,
                           float *xyz, double *lungs, supine_error *error) {
  double weights[SUPINE_MODES_MAX];
  double scales[SUPINE_LUNGS_MAX];
  supine_status status = supine_basis_weights(basis, gravity, weights);
  if (status == SUPINE_OK) {
    status = posed_scale(basis, weights, volume, &scales[0], error);
  }
  if (status == SUPINE_OK) {
    for (size_t j = 0; j < 2; ++j) {
      scales[j] = scales[0];
      lungs[j] = posed_lung_volume(basis, j, weights, scales[0]);
    }
    supine_deform(basis, POSED(basis, weights, scales), xyz);
  }
  return status;
}

/* Moves from one set of positions to another, by height in the chest. */
static void measure_moves(const supine_basis_info *info, const float *from, const float *to,
                          posture_figures *f) {
  double sum[3] = {0.0, 0.0, 0.0}; /* all, base, top */
  double count[3] = {0.0, 0.0, 0.0};
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    const double low = (double)info->bounds[6 * lung + 2];
    const double high = (double)info->bounds[6 * lung + 5];
    for (size_t i = info->lung_begin[lung]; i < info->lung_begin[lung + 1]; ++i) {
      const float *a = from + 3 * i;
      const float *b = to + 3 * i;
      const double x = (double)b[0] - (double)a[0];
      const double y = (double)b[1] - (double)a[1];
      const double z = (double)b[2] - (double)a[2];
      const double move = sqrt(x * x + y * y + z * z);
      const double height = ((double)info->vertices[3 * i + 2] - low) / (high - low);
      const size_t part = height < 0.5 ? 1 : height > 2.0 / 3.0 ? 2 : 0;
      sum[0] += move;
      count[0] += 1.0;
      if (part > 0) {
        sum[part] += move;
        count[part] += 1.0;
      }
      f->move_max = fmax(f->move_max, move);
    }
  }
  f->move_mean = sum[0] / count[0];
  f->move_base = sum[1] / count[1];
  f->move_top = sum[2] / count[2];
}

/* Volumes of the file's surface, mL. */
static void reference_volumes(const supine_mesh *mesh, const supine_basis_info *info,
                              double *volumes) {
  volumes[0] = volumes[1] = 0.0;
  size_t begin = 0;
  for (size_t lung = 0; lung < 2; ++lung) {
    size_t end = begin;
    while (end < mesh->triangle_count && mesh->triangles[3 * end] < info->lung_begin[lung + 1]) {
      ++end;
    }
    const supine_mesh part = {mesh->vertex_count, mesh->vertices, end - begin,
                              mesh->triangles + 3 * begin};
    volumes[lung] = 1e-3 * supine_mesh_volume(&part);
    begin = end;
  }
}

supine_status postures_measure(const supine_basis *basis, posture_figures figures[POSTURE_COUNT],
                               supine_error *error) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  const size_t n = info->vertex_count;
  float *xyz[3] = {NULL}; /* supine rest, rest, after a breath */
  double *wide = malloc(6 * n * sizeof *wide);
  supine_mesh mesh = {n, wide, info->triangle_count, NULL};
  mesh.triangles = malloc(3 * info->triangle_count * sizeof *mesh.triangles);
  supine_status status = SUPINE_OK;
  for (size_t k = 0; k < 3; ++k) {
    xyz[k] = malloc(3 * n * sizeof(float));
    status = xyz[k] == NULL ? SUPINE_ERROR_MEMORY : status;
  }
  if (status != SUPINE_OK || wide == NULL || mesh.triangles == NULL) {
    status = supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu vertices", n);
    goto cleanup;
  }
  for (size_t i = 0; i < 3 * n; ++i) {
    wide[i] = (double)info->vertices[i];
  }
  for (size_t i = 0; i < 3 * info->triangle_count; ++i) {
    mesh.triangles[i] = info->triangles[i];
  }
  double full[2];
  reference_volumes(&mesh, info, full);
  const double breath = breath_share * (full[0] + full[1]);
  for (size_t p = 0; p < POSTURE_COUNT && status == SUPINE_OK; ++p) {
    posture_figures *f = &figures[p];
    double gravity[3];
    double rest = 0.0;
    double before[2];
    double after[2];
    supine_slab slabs[2][QUARTERS];
    *f = (posture_figures){0};
    (void)supine_posture_gravity(posture_figure_names[p], gravity);
    (void)posed_rest(basis, gravity, &rest);
    status = place(basis, gravity, rest, xyz[p == 0 ? 0 : 1], before, error);
    if (status == SUPINE_OK) {
      status = place(basis, gravity, rest + breath, xyz[2], after, error);
    }
    if (status == SUPINE_OK) {
      status = supine_compare_slabs(basis, gravity, xyz[p == 0 ? 0 : 1], xyz[2], QUARTERS, slabs[0],
                                    error);
    }
    if (status != SUPINE_OK) {
      break;
    }
    if (p > 0) {
      measure_moves(info, xyz[0], xyz[1], f);
    }
    for (size_t i = 0; i < 3 * n; ++i) {
      wide[3 * n + i] = (double)xyz[p == 0 ? 0 : 1][i];
    }
    f->turned_over = supine_mesh_turned_over(&mesh, wide + 3 * n);
    for (size_t j = 0; j < 2; ++j) {
      f->volume[j] = full[j] + before[j];
      f->change[j] = f->volume[j] / figures[0].volume[j] - 1.0;
      f->breath[j] = (after[j] - before[j]) / breath;
    }
    const double upper =
        (slabs[0][0].gain + slabs[1][0].gain) / (slabs[0][0].volume + slabs[1][0].volume);
    const double lower = (slabs[0][QUARTERS - 1].gain + slabs[1][QUARTERS - 1].gain) /
                         (slabs[0][QUARTERS - 1].volume + slabs[1][QUARTERS - 1].volume);
    f->dependent = lower / upper;
  }
cleanup:
  free(mesh.triangles);
  free(wide);
  for (size_t k = 0; k < 3; ++k) {
    free(xyz[k]);
  }
  return status;
}
