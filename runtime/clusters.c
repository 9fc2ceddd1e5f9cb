/* SPDX-License-Identifier: MIT */
/* Evaluate bases of clusters: once a frame for each cluster, and pack what each vertex needs. */
#include <math.h>
#include <string.h>

#include "base/clones.h"
#include "runtime/cluster_row.h"
#include "runtime/clusters.h"
#include "runtime/safetensors/safetensors_file.h"

/* Ranges with fewer vertices look up which clusters they need. */
enum { ALL_CLUSTERS = 4096 };

/* Sum the numbers of a cluster over its modes, times the weights of the modes. */
static inline void sum_modes(const float *vectors, const float *weights, size_t modes,
                             float sum[SUPINE_CLUSTER_NUMBERS]) {
  memset(sum, 0, SUPINE_CLUSTER_NUMBERS * sizeof *sum);
  for (size_t k = 0; k < modes; ++k, vectors += SUPINE_CLUSTER_NUMBERS) {
    for (size_t i = 0; i < SUPINE_CLUSTER_NUMBERS; ++i) {
      sum[i] += weights[k] * vectors[i];
    }
  }
}

/* Write the frame of a cluster: b, the columns of A, Q_0 and Q_1, four numbers each. */
static inline void write_frame(const float sum[SUPINE_CLUSTER_NUMBERS], const double gains[3],
                               float *frame) {
  memset(frame, 0, SUPINE_CLUSTER_FRAME * sizeof *frame);
  for (size_t axis = 0; axis < 3; ++axis) {
    const float gain = (float)gains[axis];
    frame[axis] = gain * sum[SUPINE_CLUSTER_MEAN + axis];
    for (size_t column = 0; column < 3; ++column) {
      const float one = axis == column ? 1 : 0;
      frame[4 + 4 * column + axis] = one + gain * sum[SUPINE_CLUSTER_SLOPE + 3 * axis + column];
    }
    frame[16 + axis] = gain * sum[SUPINE_CLUSTER_PATTERN + axis];
    frame[20 + axis] = gain * sum[SUPINE_CLUSTER_PATTERN + 3 + axis];
  }
}

/* The clones must be static: the resolver of an external function would be exported. */
SUPINE_CLONES static void pose_clusters(const supine_basis *basis, const supine_pose *pose,
                                        size_t begin, size_t end, float *frames) {
  const supine_basis_info *info = &basis->info;
  const size_t modes = info->mode_count;
  bool needed[SUPINE_CLUSTERS_MAX] = {false};
  float weights[SUPINE_MODES_MAX];
  if (end - begin < ALL_CLUSTERS) {
    const size_t whole = (end + TILE - 1) / TILE * TILE; /* kernels evaluate whole tiles */
    const size_t last = whole < info->vertex_count ? whole : info->vertex_count;
    for (size_t i = begin / TILE * TILE; i < last; ++i) {
      needed[info->cluster[i]] = true;
    }
  }
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    for (size_t k = 0; k < modes; ++k) {
      weights[k] = (float)supine_basis_lung_weights(basis, pose, lung)[k];
    }
    for (size_t c = 0; c < info->cluster_count; ++c) {
      if (basis->cluster_lung[c] == lung && (needed[c] || end - begin >= ALL_CLUSTERS)) {
        float sum[SUPINE_CLUSTER_NUMBERS];
        sum_modes(info->cluster_vectors + c * modes * SUPINE_CLUSTER_NUMBERS, weights, modes, sum);
        write_frame(sum, pose->gains[lung], frames + c * SUPINE_CLUSTER_FRAME);
      }
    }
  }
}

void supine_clusters_pose(const supine_basis *basis, const supine_pose *pose, size_t begin,
                          size_t end, float *frames) {
  pose_clusters(basis, pose, begin, end, frames);
}

void supine_clusters_coefficients(const supine_basis *basis, size_t begin, size_t end,
                                  float *coefficients) {
  const supine_basis_info *info = &basis->info;
  const size_t modes = info->mode_count;
  for (size_t i = begin; i < end; ++i) {
    supine_cluster_row(info->cluster_vectors + info->cluster[i] * modes * SUPINE_CLUSTER_NUMBERS,
                       modes, info->vertices + 3 * i, info->cluster_scalars + 2 * i,
                       coefficients + 3 * modes * (i - begin));
  }
}

static double length(const float *numbers, size_t count) {
  double square = 0;
  for (size_t i = 0; i < count; ++i) {
    square += (double)numbers[i] * (double)numbers[i];
  }
  return sqrt(square);
}

/* Bound what enters the sum of a vertex for each mode, by the largest of all clusters. */
static void bound_modes(supine_basis *basis) {
  static const double scalar_most = 32768; /* of a 16-bit integer */
  const supine_basis_info *info = &basis->info;
  const size_t modes = info->mode_count;
  memset(basis->mode_size, 0, modes * sizeof *basis->mode_size);
  for (size_t row = 0; row < info->cluster_count * modes; ++row) {
    const float *v = info->cluster_vectors + row * SUPINE_CLUSTER_NUMBERS;
    const double mean = length(v + SUPINE_CLUSTER_MEAN, 3);
    const double slope = length(v + SUPINE_CLUSTER_SLOPE, 9);
    const double patterns = length(v + SUPINE_CLUSTER_PATTERN, 6);
    const double size = mean + slope * basis->reference_size + 2 * scalar_most * patterns;
    double *most = &basis->mode_size[row % modes];
    *most = fmax(*most, size);
  }
}

supine_status supine_clusters_pack(supine_basis *basis) {
  supine_basis_info *info = &basis->info;
  supine_tiles *tiles = &basis->tiles;
  double farthest = 0;
  supine_tiles_layout_clusters(tiles, (info->vertex_count + TILE - 1) / TILE);
  tiles->bytes = supine_safetensors_allocate(basis->file, tiles->count * tiles->stride);
  if (tiles->bytes == NULL) {
    return SUPINE_ERROR_MEMORY;
  }
  for (size_t v = 0; v < tiles->count * TILE; ++v) { /* the last tile repeats the last vertex */
    const size_t i = v < info->vertex_count ? v : info->vertex_count - 1;
    unsigned char *tile = tiles->bytes + v / TILE * tiles->stride;
    unsigned char *vertex = tile + v % TILE * 4 * sizeof(float);
    memcpy(vertex, info->vertices + 3 * i, 3 * sizeof(float));
    memcpy(vertex + 3 * sizeof(float), info->cluster_scalars + 2 * i, 2 * sizeof(int16_t));
    memcpy(tile + tiles->reference_begin + v % TILE * sizeof(uint16_t), &info->cluster[i],
           sizeof(uint16_t));
  }
  for (size_t i = 0; i < 6 * info->lung_count; ++i) {
    const double distance = fabs((double)info->bounds[i]);
    if (distance > farthest) { /* with fmax, GCC 12 for aarch64 ends with an internal error */
      farthest = distance;
    }
  }
  basis->reference_size = sqrt(3) * farthest;
  basis->reference_error = 6 * 0x1p-24 * basis->reference_size; /* of the products A p */
  bound_modes(basis);
  info->storage = SUPINE_STORAGE_EXACT;
  info->packed = tiles->bytes;
  info->bytes_per_vertex = (double)tiles->stride / TILE;
  return SUPINE_OK;
}

const float *supine_basis_rows(const supine_basis *basis, size_t i, float *computed) {
  const supine_basis_info *info = &basis->info;
  if (info->cluster_count == 0) {
    return info->coefficients + i * (info->vector ? 3 : 1) * info->mode_count;
  }
  supine_clusters_coefficients(basis, i, i + 1, computed);
  return computed;
}

supine_status supine_basis_coefficients(const supine_basis *basis, size_t begin, size_t end,
                                        float *coefficients) {
  const size_t row = 3 * basis->info.mode_count;
  if (!basis->info.vector) {
    return SUPINE_ERROR_UNSUPPORTED;
  }
  if (begin > end || end > basis->info.vertex_count) {
    return SUPINE_ERROR_ARGUMENT;
  }
  if (basis->info.cluster_count > 0) {
    supine_clusters_coefficients(basis, begin, end, coefficients);
  } else {
    memcpy(coefficients, basis->info.coefficients + begin * row,
           (end - begin) * row * sizeof *coefficients);
  }
  return SUPINE_OK;
}
