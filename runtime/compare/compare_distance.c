/* SPDX-License-Identifier: MIT */
/* Compute the distance of every vertex, and statistics of distances. */
#include <math.h>
#include <stdint.h>
#include <string.h>

#include "sh/base/vec3.h"

#include "runtime/compare/compare_internal.h"

static double dot(const double *weights, const float *coefficients, size_t count) {
  double sum = 0;
  for (size_t k = 0; k < count; ++k) {
    sum += weights[k] * (double)coefficients[k];
  }
  return sum;
}

/* Compute |u_i| of the field with products of gains and weights q [3, K], mm. */
static double displacement(const supine_basis *basis, const double *q, size_t i) {
  const size_t count = basis->info.mode_count;
  double u[3];
  if (basis->info.vector) {
    for (size_t axis = 0; axis < 3; ++axis) {
      u[axis] = dot(q + axis * count, basis->info.coefficients + (3 * i + axis) * count, count);
    }
    return supine_length(u);
  }
  for (size_t axis = 0; axis < 3; ++axis) {
    u[axis] = dot(q + axis * count, basis->info.coefficients + i * count, count) *
              (double)basis->info.direction[3 * i + axis];
  }
  return supine_length(u);
}

void supine_compare_distances(const supine_compare *compare, const supine_pose *pose,
                              const supine_pose *from, float *distance) {
  const supine_basis *basis = compare->basis;
  double q[3 * SUPINE_LUNGS_MAX * SUPINE_MODES_MAX];
  supine_compare_state(compare, pose, from, q);
  for (size_t lung = 0; lung < basis->info.lung_count; ++lung) {
    for (size_t i = basis->lung_begin[lung]; i < basis->lung_begin[lung + 1]; ++i) {
      distance[i] = (float)displacement(basis, q + 3 * lung * basis->info.mode_count, i);
    }
  }
}

/* Find the smallest distance that at least `target` of the area does not exceed. The bits of floats
 * that are not negative sort as the floats do: three histograms of the area, over 2^11 values each,
 * determine the upper, middle and lower bits. */
static double percentile(const supine_compare *compare, const float *distance, double target) {
  enum { ROUNDS = 3, BITS = 11, BINS = 1 << BITS };
  const size_t n = compare->basis->info.vertex_count;
  uint32_t prefix = 0;
  double below = 0;
  for (int round = 0; round < ROUNDS; ++round) {
    const unsigned shift = (unsigned)(BITS * (ROUNDS - 1 - round));
    double bin[BINS] = {0};
    for (size_t i = 0; i < n; ++i) {
      uint32_t bits = 0;
      memcpy(&bits, &distance[i], sizeof bits);
      if (round == 0 || bits >> (shift + BITS) == prefix) {
        bin[(bits >> shift) & (BINS - 1)] += (double)compare->share[i];
      }
    }
    uint32_t at = 0;
    uint32_t last = 0; /* last bin that is not empty, if rounding leaves the target above the sum */
    for (; at < BINS && (bin[at] == 0 || below + bin[at] < target); ++at) {
      below += bin[at];
      last = bin[at] > 0 ? at : last;
    }
    if (at == BINS) {
      at = last;
      below -= bin[at];
    }
    prefix = prefix << BITS | at;
  }
  float value = 0;
  memcpy(&value, &prefix, sizeof value);
  return (double)value;
}

void supine_compare_statistics(const supine_compare *compare, const float *distance,
                               supine_distance_statistics *statistics) {
  double area = 0;
  double sum = 0;
  double square = 0;
  float largest = 0;
  for (size_t i = 0; i < compare->basis->info.vertex_count; ++i) {
    const double share = (double)compare->share[i];
    const double d = (double)distance[i];
    area += share; /* 1 up to rounding */
    sum += share * d;
    square += share * d * d;
    largest = distance[i] > largest ? distance[i] : largest;
  }
  statistics->mean = sum / area;
  statistics->rms = sqrt(square / area);
  statistics->p95 = percentile(compare, distance, 0.95 * area);
  statistics->max = (double)largest;
}
