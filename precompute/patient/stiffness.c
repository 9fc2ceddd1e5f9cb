/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Evaluate the stiffness of lung regions at the vertices of a surface. */
#include <math.h>

#include "precompute/patient/matching.h"

#include "base/arena.h"
#include "base/csv.h"
#include "base/output.h"
#include "base/text.h"
#include "base/vec3.h"

void supine_patient_stiffness_shares(const supine_patient_stiffness *stiffness,
                                     const supine_lungs *lungs, size_t vertex, double *shares) {
  const double *point = lungs->mesh.vertices + 3 * vertex;
  const int side = supine_patient_side_of(lungs, vertex);
  double sum = 0.0;
  double least = INFINITY;
  size_t nearest = 0;
  for (size_t k = 0; k < stiffness->count; ++k) {
    const supine_patient_region *region = &stiffness->region[k];
    const double distance =
        region->side == side ? supine_distance(region->centre, point) : INFINITY;
    const double q = fmin(1.0, fmax(0.0, 2.0 - 2.0 * distance / region->radius));
    shares[k] = q * q * (3.0 - 2.0 * q);
    sum += shares[k];
    nearest = distance < least ? k : nearest;
    least = fmin(least, distance);
  }
  for (size_t k = 0; k < stiffness->count; ++k) {
    shares[k] = sum > 0.0 ? shares[k] / sum : (double)(k == nearest);
  }
}

void supine_patient_stiffness_of(const supine_patient_stiffness *stiffness,
                                 const supine_lungs *lungs, double *e) {
  double shares[SUPINE_PATIENT_REGIONS_MAX];
  for (size_t i = 0; i < lungs->mesh.vertex_count; ++i) {
    double a = stiffness->count == 0 ? 1.0 : 0.0;
    supine_patient_stiffness_shares(stiffness, lungs, i, shares);
    for (size_t k = 0; k < stiffness->count; ++k) {
      a += stiffness->region[k].expandability * shares[k];
    }
    e[i] = 1.0 / a;
  }
}

supine_status supine_patient_stiffness_write(const char *path,
                                             const supine_patient_stiffness *stiffness,
                                             const supine_lungs *lungs, supine_error *error) {
  const size_t n = lungs->mesh.vertex_count;
  supine_output output = {0};
  SUPINE_ARENA arena = {0};
  float *a = supine_arena_take(&arena, n, sizeof *a);
  float *determined = supine_arena_zeros(&arena, n, sizeof *determined);
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu vertices", n));
  for (size_t i = 0; i < n; ++i) {
    double shares[SUPINE_PATIENT_REGIONS_MAX];
    supine_patient_stiffness_shares(stiffness, lungs, i, shares);
    a[i] = stiffness->count == 0 ? 1.0F : 0.0F;
    for (size_t k = 0; k < stiffness->count; ++k) {
      a[i] += (float)(shares[k] * stiffness->region[k].expandability);
      determined[i] += (float)(shares[k] * stiffness->region[k].determined);
    }
  }
  if (!supine_text_ends_in(path, ".csv")) {
    const supine_mesh_save_options save = {
        .scalars = {{"expandability", a}, {"determined", determined}}};
    return supine_mesh_save(path, &lungs->mesh, &save, error);
  }
  SUPINE_TRY(supine_output_open(path, &output, error));
  (void)fputs("vertex,x_mm,y_mm,z_mm,expandability,determined\n", output.file);
  for (size_t i = 0; i < n; ++i) {
    const double *p = lungs->mesh.vertices + 3 * i;
    supine_csv_row row = {.file = output.file};
    supine_csv_add(&row, "%zu,%.6g,%.6g,%.6g,%.5g,%.3g", i, p[0], p[1], p[2], (double)a[i],
                   (double)determined[i]);
    supine_csv_end_row(&row);
  }
  return supine_output_commit(&output, error);
}
