/* SPDX-License-Identifier: MIT */
/* Compare poses by the distances of vertices, and compute the energy of each band of harmonics from
 * a Gram matrix, without a pass over the vertices. */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <supine/compare.h>
#include <supine/sh.h>

#include "base/arena.h"
#include "base/vec3.h"
#include "runtime/internal.h"

struct supine_compare {
  const supine_basis *basis;
  double area;  /* area of the reference surface, mm^2 */
  float *share; /* [N] fraction of the area that belongs to each vertex */
  double *gram; /* [modes, modes] Gram matrix of the modes, mm^2 */
};

static const double four_pi = 12.566370614359172954;

static double twice_area(const supine_basis *basis, const uint32_t *corner) {
  double p[3][3];
  double normal[3];
  for (size_t i = 0; i < 9; ++i) {
    p[i / 3][i % 3] = (double)basis->info.vertices[3 * (size_t)corner[i / 3] + i % 3];
  }
  supine_normal(p[0], p[1], p[2], normal);
  return supine_length(normal);
}

static supine_status share_area(supine_compare *compare, supine_error *error) {
  const supine_basis *basis = compare->basis;
  double *area = calloc(basis->info.vertex_count, sizeof *area);
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
  if (total > 0) {
    for (size_t i = 0; i < basis->info.vertex_count; ++i) {
      compare->share[i] = (float)(area[i] / total);
    }
  }
  free(area);
  return total > 0 && isfinite(total)
             ? SUPINE_OK
             : supine_error_set(error, SUPINE_ERROR_MESH,
                                "the area of the surface is 0 or not finite: give a basis of the "
                                "lungs' surface");
}

/* Add `weight` times c c^T to the upper triangle of `gram` [count, count]. */
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

/* Add the part of one lung and axis to the Gram matrix.
 * @param part  [modes, modes] work space */
static void add_gram(supine_compare *compare, size_t lung, size_t axis, double *part) {
  const supine_basis *basis = compare->basis;
  const size_t count = basis->info.mode_count;
  memset(part, 0, count * count * sizeof *part);
  for (size_t i = basis->lung_begin[lung]; i < basis->lung_begin[lung + 1]; ++i) {
    const double share = (double)compare->share[i];
    const double d = basis->info.vector ? 1 : (double)basis->info.direction[3 * i + axis];
    float computed[3 * SUPINE_MODES_MAX];
    const float *rows = supine_basis_rows(basis, i, computed);
    add_row(rows + (basis->info.vector ? axis * count : 0), share * d * d, count, part);
  }
  for (size_t k = 0; k < count; ++k) {
    for (size_t l = 0; l < count; ++l) {
      compare->gram[k * count + l] += part[k < l ? k * count + l : l * count + k];
    }
  }
}

supine_status supine_compare_create(const supine_basis *basis, supine_compare **compare,
                                    supine_error *error) {
  const supine_basis_info *info = &basis->info;
  const size_t square = info->mode_count * info->mode_count;
  const size_t numbers = 2 * square; /* the Gram matrix and work space */
  supine_compare *made = calloc(1, sizeof *made + numbers * sizeof *made->gram +
                                       info->vertex_count * sizeof *made->share);
  if (made == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "out of memory");
  }
  made->basis = basis;
  made->gram = (double *)(made + 1);
  made->share = (float *)(void *)(made->gram + numbers);
  const supine_status status = share_area(made, error);
  if (status != SUPINE_OK) {
    supine_compare_destroy(made);
    return status;
  }
  for (size_t i = 0; i < 3 * info->lung_count; ++i) {
    add_gram(made, i / 3, i % 3, made->gram + square);
  }
  *compare = made;
  return SUPINE_OK;
}

void supine_compare_destroy(supine_compare *compare) {
  free(compare);
}

double supine_compare_area(const supine_compare *compare) {
  return compare->area;
}

/* For each lung, axis and mode, write the displacement factor times the weight of `pose` to `q`.
 * Unless `from` is NULL, subtract the same product of `from`. Return false if a pose is of another
 * basis, or has a number that is not finite. */
static bool products_of(const supine_compare *compare, const supine_pose *pose,
                        const supine_pose *from, double *q) {
  const supine_basis *basis = compare->basis;
  for (size_t i = 0; i < 3 * basis->info.lung_count; ++i) {
    const double *to = supine_basis_lung_weights(basis, pose, i / 3);
    for (size_t k = 0; k < basis->info.mode_count; ++k) {
      *q = pose->gains[i / 3][i % 3] * to[k];
      if (from != NULL) {
        *q -= from->gains[i / 3][i % 3] * supine_basis_lung_weights(basis, from, i / 3)[k];
      }
      ++q;
    }
  }
  return supine_basis_has_pose(compare->basis, pose) &&
         (from == NULL || supine_basis_has_pose(compare->basis, from));
}

void supine_compare_energy(const supine_compare *compare, double *energy) {
  const size_t count = compare->basis->info.mode_count;
  const size_t orders = compare->basis->info.order + 1; /* products of each harmonic */
  const size_t terms = supine_sh_count(compare->basis->info.band) * orders;
  size_t term = 0;
  for (size_t l = 0; l <= compare->basis->info.band; ++l) {
    energy[l] = 0;
    for (; term < (l + 1) * (l + 1) * orders; ++term) {
      double column[SUPINE_MODES_MAX];
      for (size_t k = 0; k < count; ++k) {
        column[k] = compare->basis->info.modes[k * terms + term];
      }
      energy[l] += supine_volume_square(count, compare->gram, column) / four_pi;
    }
  }
}

static double dot(const double *weights, const float *coefficients, size_t count) {
  double sum = 0;
  for (size_t k = 0; k < count; ++k) {
    sum += weights[k] * (double)coefficients[k];
  }
  return sum;
}

/* Return the length of the displacement of vertex i, mm. `q` points to the products of gain and
 * weight [3, modes] for one lung (products_of). */
static double displacement(const supine_basis *basis, const double *q, size_t i) {
  const size_t count = basis->info.mode_count;
  float computed[3 * SUPINE_MODES_MAX];
  const float *rows = supine_basis_rows(basis, i, computed);
  double u[3];
  for (size_t axis = 0; axis < 3; ++axis) {
    u[axis] = dot(q + axis * count, rows + (basis->info.vector ? axis * count : 0), count) *
              (basis->info.vector ? 1 : (double)basis->info.direction[3 * i + axis]);
  }
  return supine_length(u);
}

/* Write the distance of each vertex between two poses, one of which at least expands a lung, so
 * that the products of the modes do not give the distance.
 * @param from  NULL for the reference surface */
static void expanded_distances(const supine_basis *basis, const supine_pose *pose,
                               const supine_pose *from, float *distance) {
  enum { BLOCK = 256 };
  float x[3 * BLOCK];
  float origin[3 * BLOCK] = {0};
  for (size_t begin = 0; begin < basis->info.vertex_count; begin += BLOCK) {
    const size_t left = basis->info.vertex_count - begin;
    const size_t count = left < BLOCK ? left : BLOCK;
    (void)supine_displace_range(basis, pose, begin, begin + count, x);
    if (from != NULL) {
      (void)supine_displace_range(basis, from, begin, begin + count, origin);
    }
    for (size_t i = 0; i < count; ++i) {
      double u[3];
      for (size_t axis = 0; axis < 3; ++axis) {
        u[axis] = (double)x[3 * i + axis] - (double)origin[3 * i + axis];
      }
      distance[begin + i] = (float)supine_length(u);
    }
  }
}

supine_status supine_compare_distances(const supine_compare *compare, const supine_pose *pose,
                                       const supine_pose *from, float *distance) {
  const supine_basis *basis = compare->basis;
  double q[3 * SUPINE_LUNGS_MAX * SUPINE_MODES_MAX];
  if (!products_of(compare, pose, from, q)) {
    return SUPINE_ERROR_ARGUMENT;
  }
  if (supine_basis_expansion(basis, pose) > 0 ||
      (from != NULL && supine_basis_expansion(basis, from) > 0)) {
    expanded_distances(basis, pose, from, distance);
    return SUPINE_OK;
  }
  for (size_t lung = 0; lung < basis->info.lung_count; ++lung) {
    for (size_t i = basis->lung_begin[lung]; i < basis->lung_begin[lung + 1]; ++i) {
      distance[i] = (float)displacement(basis, q + 3 * lung * basis->info.mode_count, i);
    }
  }
  return SUPINE_OK;
}

/* Find the largest d such that the vertices with distances below d have less than the fraction
 * `target` of the area. Non-negative floats have the same order as their bits, which are thus found
 * one after another, from the highest on. */
static double percentile(const supine_compare *compare, const float *distance, double target) {
  uint32_t found = 0;
  float value = 0;
  for (uint32_t bit = UINT32_C(1) << 30; bit > 0; bit >>= 1) {
    const uint32_t larger = found | bit;
    double below = 0;
    memcpy(&value, &larger, sizeof value);
    for (size_t i = 0; i < compare->basis->info.vertex_count; ++i) {
      below += distance[i] < value ? (double)compare->share[i] : 0;
    }
    found = below < target ? larger : found;
  }
  memcpy(&value, &found, sizeof value);
  return (double)value;
}

void supine_compare_statistics(const supine_compare *compare, const float *distance,
                               supine_distance_statistics *statistics) {
  double shares = 0;
  double sum = 0;
  double square = 0;
  float largest = 0;
  for (size_t i = 0; i < compare->basis->info.vertex_count; ++i) {
    const double share = (double)compare->share[i];
    const double d = (double)distance[i];
    shares += share;
    sum += share * d;
    square += share * d * d;
    largest = distance[i] > largest ? distance[i] : largest;
  }
  statistics->mean = sum / shares;
  statistics->rms = sqrt(square / shares);
  statistics->p95 = percentile(compare, distance, 0.95 * shares);
  statistics->max = (double)largest;
}
