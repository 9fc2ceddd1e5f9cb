/* SPDX-License-Identifier: MIT */
/* Compute the Gram matrices of a basis, and from them distances, gains and energies. */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>

#include "sh/base/vec3.h"
#include <supine/sh.h>

#include "runtime/compare/compare_internal.h"

static const double four_pi = 12.566370614359172954;

static double twice_area(const supine_basis *basis, const uint32_t *corner) {
  const float *a = basis->info.vertices + 3 * (size_t)corner[0];
  const float *b = basis->info.vertices + 3 * (size_t)corner[1];
  const float *c = basis->info.vertices + 3 * (size_t)corner[2];
  double u[3];
  double v[3];
  for (int axis = 0; axis < 3; ++axis) {
    u[axis] = (double)b[axis] - (double)a[axis];
    v[axis] = (double)c[axis] - (double)a[axis];
  }
  double product[3];
  supine_cross(u, v, product);
  return supine_length(product);
}

/* Compute a_i: a third of the area of vertex i's triangles, over the area of all. */
static supine_status share_area(supine_compare *compare, supine_error *error) {
  const supine_basis *basis = compare->basis;
  const size_t n = basis->info.vertex_count;
  double *area = calloc(n, sizeof *area);
  if (area == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "out of memory");
  }
  double total = 0;
  for (size_t t = 0; t < basis->info.triangle_count; ++t) {
    const uint32_t *corner = basis->info.triangles + 3 * t;
    const double piece = twice_area(basis, corner) / 6;
    for (int v = 0; v < 3; ++v) {
      area[corner[v]] += piece;
    }
    total += 3 * piece;
  }
  compare->area = total;
  for (size_t i = 0; i < n && total > 0; ++i) {
    compare->share[i] = (float)(area[i] / total);
  }
  free(area);
  return total > 0 && isfinite(total)
             ? SUPINE_OK
             : supine_error_set(error, SUPINE_ERROR_MESH,
                                "the surface has no area, or one that is not finite: no average "
                                "over it exists");
}

/* Add weight c c^T to the upper triangle of `gram`. */
static void add_row(const float *c, double weight, size_t count, double *gram) {
  double row[SUPINE_MODES_MAX];
  for (size_t k = 0; k < count; ++k) {
    row[k] = (double)c[k];
  }
  for (size_t k = 0; k < count; ++k) {
    const double scaled = weight * row[k];
    double *out = gram + k * count;
    for (size_t l = k; l < count; ++l) {
      out[l] += scaled * row[l];
    }
  }
}

static void find_gram(supine_compare *compare, size_t lung, size_t axis) {
  const supine_basis *basis = compare->basis;
  const size_t count = basis->info.mode_count;
  double *gram = compare->gram + (3 * lung + axis) * count * count;
  for (size_t i = basis->lung_begin[lung]; i < basis->lung_begin[lung + 1]; ++i) {
    const double share = (double)compare->share[i];
    if (basis->info.vector) {
      add_row(basis->info.coefficients + (3 * i + axis) * count, share, count, gram);
    } else {
      const double d = (double)basis->info.direction[3 * i + axis];
      add_row(basis->info.coefficients + i * count, share * d * d, count, gram);
    }
  }
  for (size_t k = 0; k < count; ++k) {
    for (size_t l = 0; l < k; ++l) {
      gram[k * count + l] = gram[l * count + k];
    }
  }
  for (size_t k = 0; k < count * count; ++k) {
    compare->sum[k] += gram[k];
  }
}

supine_status supine_compare_create(const supine_basis *basis, supine_compare **compare,
                                    supine_error *error) {
  const supine_basis_info *info = &basis->info;
  const size_t square = info->mode_count * info->mode_count;
  supine_status status = SUPINE_ERROR_MEMORY;
  supine_compare *made = calloc(1, sizeof *made);
  if (made == NULL) {
    return supine_error_set(error, status, "out of memory");
  }
  made->basis = basis;
  made->share = calloc(info->vertex_count, sizeof *made->share);
  made->gram = calloc(3 * info->lung_count * square, sizeof *made->gram);
  made->sum = calloc(square, sizeof *made->sum);
  if (made->share == NULL || made->gram == NULL || made->sum == NULL) {
    (void)supine_error_set(error, status, "out of memory");
    goto cleanup;
  }
  status = share_area(made, error);
  if (status != SUPINE_OK) {
    goto cleanup;
  }
  for (size_t i = 0; i < 3 * info->lung_count; ++i) {
    find_gram(made, i / 3, i % 3);
  }
  *compare = made;
  made = NULL;
cleanup:
  supine_compare_destroy(made);
  return status;
}

void supine_compare_destroy(supine_compare *compare) {
  if (compare != NULL) {
    free(compare->share);
    free(compare->gram);
    free(compare->sum);
    free(compare);
  }
}

double supine_compare_area(const supine_compare *compare) {
  return compare->area;
}

/* Compute q^T G p, where q and p have `count` numbers. */
static double product(const double *gram, const double *q, const double *p, size_t count) {
  double sum = 0;
  for (size_t k = 0; k < count; ++k) {
    double row = 0;
    for (size_t l = 0; l < count; ++l) {
      row += gram[k * count + l] * p[l];
    }
    sum += q[k] * row;
  }
  return sum;
}

void supine_compare_state(const supine_compare *compare, const supine_pose *pose,
                          const supine_pose *from, double *q) {
  for (size_t i = 0; i < 3 * compare->basis->info.lung_count; ++i) {
    for (size_t k = 0; k < compare->basis->info.mode_count; ++k) {
      *q++ = pose->gains[i / 3][i % 3] * pose->weights[k] -
             (from == NULL ? 0 : from->gains[i / 3][i % 3] * from->weights[k]);
    }
  }
}

double supine_compare_square(const supine_compare *compare, const double *q) {
  const size_t count = compare->basis->info.mode_count;
  double square = 0;
  for (size_t i = 0; i < 3 * compare->basis->info.lung_count; ++i) {
    square += product(compare->gram + i * count * count, q + i * count, q + i * count, count);
  }
  return square;
}

double supine_compare_rms(const supine_compare *compare, const supine_pose *pose,
                          const supine_pose *from) {
  double q[3 * SUPINE_LUNGS_MAX * SUPINE_MODES_MAX];
  supine_compare_state(compare, pose, from, q);
  return sqrt(fmax(supine_compare_square(compare, q), 0));
}

supine_status supine_compare_pose(const supine_compare *compare, const supine_state *state,
                                  double rms, supine_pose *pose, supine_error *error) {
  if (!(rms > 0)) {
    return supine_basis_pose(compare->basis, state, pose, error);
  }
  if (supine_basis_weights(compare->basis, state->gravity, pose->weights) != SUPINE_OK) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT, "gravity has no direction");
  }
  supine_pose_fill(pose, 1);
  const double one = supine_compare_rms(compare, pose, NULL);
  if (!(one > 0)) {
    return supine_error_set(error, SUPINE_ERROR_NUMERICAL,
                            "no vertex moves in this direction of gravity: no gain gives an RMS of "
                            "%g mm",
                            rms);
  }
  supine_pose_fill(pose, rms / one);
  return SUPINE_OK;
}

void supine_compare_energy(const supine_compare *compare, double *energy) {
  const size_t count = compare->basis->info.mode_count;
  const size_t terms = supine_sh_count(compare->basis->info.band);
  size_t term = 0;
  for (size_t l = 0; l <= compare->basis->info.band; ++l) {
    energy[l] = 0;
    for (; term < (l + 1) * (l + 1); ++term) {
      double column[SUPINE_MODES_MAX];
      for (size_t k = 0; k < count; ++k) {
        column[k] = compare->basis->info.modes[k * terms + term];
      }
      energy[l] += product(compare->sum, column, column, count) / four_pi;
    }
  }
}
