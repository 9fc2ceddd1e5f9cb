/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute volume, positions, surface and expected errors of a basis in a pose. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"
#include "precompute/posed/posed.h"

double supine_posed_volume(const supine_basis *basis, const supine_pose *pose) {
  double volumes[SUPINE_LUNGS_MAX] = {0.0};
  double sum = 0.0;
  (void)supine_basis_volumes(basis, pose, volumes);
  for (size_t lung = 0; lung < supine_basis_get_info(basis)->lung_count; ++lung) {
    sum += volumes[lung];
  }
  return sum;
}

supine_status supine_posed_positions(const supine_basis *basis, const supine_pose *pose,
                                     double *positions, supine_error *error) {
  const size_t n = supine_basis_get_info(basis)->vertex_count;
  const float *found = supine_basis_vertices(basis);
  SUPINE_ARENA arena = {0};
  if (pose != NULL) {
    float *xyz = supine_arena_take(&arena, n, 3 * sizeof *xyz);
    SUPINE_TRY(supine_arena_check(&arena, error, "%zu vertices", n));
    (void)supine_deform(basis, pose, xyz);
    found = xyz;
  }
  for (size_t i = 0; i < 3 * n; ++i) {
    positions[i] = (double)found[i];
  }
  return SUPINE_OK;
}

supine_status supine_posed_mesh(const supine_basis *basis, const supine_pose *pose,
                                supine_mesh *mesh, supine_error *error) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  const size_t corners = 3 * info->triangle_count;
  if (supine_mesh_allocate(info->vertex_count, info->triangle_count, mesh) != SUPINE_OK) {
    return supine_error_memory(error, "%zu vertices", info->vertex_count);
  }
  memcpy(mesh->triangles, supine_basis_triangles(basis), corners * sizeof(uint32_t));
  return supine_posed_positions(basis, pose, mesh->vertices, error);
}

void supine_posed_expected_measure(size_t count, supine_expected *expected) {
  double square = 0.0;
  double another = 0.0;
  expected->largest = 0.0;
  for (size_t i = 0; i < count; ++i) {
    square += (double)expected->sigma[i] * (double)expected->sigma[i];
    if (expected->another != NULL) {
      another += (double)expected->another[i] * (double)expected->another[i];
    }
    expected->largest = fmax(expected->largest, (double)expected->sigma[i]);
  }
  expected->rms = sqrt(square / (double)count);
  expected->another_rms = sqrt(another / (double)count);
}

supine_status supine_posed_expected(const supine_basis *basis, const supine_state *state,
                                    const supine_state *from, supine_expected *expected,
                                    supine_error *error) {
  const size_t n = supine_basis_get_info(basis)->vertex_count;
  if (supine_basis_get_info(basis)->is_fields) {
    return SUPINE_OK;
  }
  float *sigma = malloc(2 * n * sizeof *sigma);
  double along = 0.0;
  if (sigma == NULL) {
    return supine_error_memory(error, "%zu vertices", n);
  }
  const supine_status status = supine_expected_error(basis, state, from, sigma, error);
  if (status != SUPINE_OK) {
    free(sigma);
    return status == SUPINE_ERROR_UNSUPPORTED || status == SUPINE_ERROR_OPEN_SURFACE ? SUPINE_OK
                                                                                     : status;
  }
  for (size_t i = 0; i < 3; ++i) {
    along += state->gravity[i] * from->gravity[i];
  }
  expected->sigma = sigma;
  expected->another = sigma + n;
  for (size_t i = 0; i < n; ++i) {
    expected->another[i] = (float)supine_expected_another_day((double)sigma[i]);
  }
  supine_posed_expected_measure(n, expected);
  expected->turned = along < 1.0 - 1e-9;
  return SUPINE_OK;
}

supine_status supine_posed_errors(const supine_basis *basis, const supine_state *state,
                                  const supine_state *from, supine_errors *errors,
                                  supine_error *error) {
  const supine_state scan = supine_basis_scan(basis);
  SUPINE_TRY(supine_posed_expected(basis, state, &scan, &errors->position, error));
  return supine_posed_expected(basis, state, from, &errors->moved, error);
}

supine_status supine_posed_simulator_error(const supine_basis *basis, const supine_state *state,
                                           supine_expected *expected, supine_error *error) {
  const size_t n = supine_basis_get_info(basis)->vertex_count;
  if (supine_basis_tensor(basis, "error_vertices") == NULL) {
    return SUPINE_OK;
  }
  expected->sigma = malloc(n * sizeof *expected->sigma);
  if (expected->sigma == NULL) {
    return supine_error_memory(error, "%zu vertices", n);
  }
  SUPINE_TRY(supine_expected_error(basis, state, NULL, expected->sigma, error));
  supine_posed_expected_measure(n, expected);
  return SUPINE_OK;
}

void supine_posed_errors_free(supine_errors *errors) {
  supine_posed_expected_free(&errors->position);
  supine_posed_expected_free(&errors->moved);
}

void supine_posed_expected_free(supine_expected *expected) {
  free(expected->sigma);
  *expected = (supine_expected){0};
}
