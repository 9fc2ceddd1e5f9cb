/* SPDX-License-Identifier: MIT */
/* Compute the normals of a deformed surface as weighted sums of vectors of the file. */
#include <string.h>

#include "base/clones.h"
#include "runtime/internal.h"
#include "runtime/kernels/compact.h"
#include "runtime/safetensors/safetensors_file.h"

/* Pack the vectors of 16 vertices (supine_basis_info.normals), from vertex `begin`
 * on. After the last vertex, repeat it. */
SUPINE_CLONES static void pack_tile(const supine_basis_info *info, const supine_tiles *tiles,
                                    size_t begin, unsigned char *to) {
  const size_t last = info->vertex_count - 1;
  const size_t words = supine_tiles_normal_words(tiles->modes);
  for (size_t at = 0; at < 3 * words; ++at, to += TILE * sizeof(uint32_t)) {
    const size_t word = at % words;
    const size_t axis = at / words;
    double three[3][TILE] = {{0}};
    uint32_t packed[TILE];
    for (size_t which = 0; which < 3 && word + which * words < tiles->modes; ++which) {
      const size_t k = word + which * words;
      for (size_t v = 0; v < TILE; ++v) {
        const size_t row = 3 * (begin + v < last ? begin + v : last) + axis;
        const int number =
            normal_from_bytes(info->normals + row * (tiles->modes + 1), tiles->modes, k);
        three[which][v] = number * (1 / normal_unit());
      }
    }
    for (size_t v = 0; v < TILE; ++v) {
      packed[v] = normal_narrow(three[0][v], three[1][v], three[2][v]);
    }
    memcpy(to, packed, sizeof packed);
  }
}

supine_status supine_basis_pack_normals(supine_basis *basis) {
  supine_tiles *tiles = &basis->lit;
  supine_tiles_layout_lit(tiles, basis->info.normal_count,
                          (basis->info.vertex_count - 1) / TILE + 1);
  tiles->bytes = supine_safetensors_allocate(basis->file, tiles->count * tiles->stride);
  if (tiles->bytes == NULL) {
    return SUPINE_ERROR_MEMORY;
  }
  for (size_t t = 0; t < tiles->count; ++t) {
    pack_tile(&basis->info, tiles, t * TILE, tiles->bytes + t * tiles->stride);
  }
  return SUPINE_OK;
}

/* Return the sum of F_kl w_k w_l over k <= l. `form` holds the rows of the upper triangle F. */
static double triangle(size_t count, const double *form, const double *w) {
  double sum = 0;
  for (size_t k = 0; k < count; ++k) {
    double row = 0;
    for (size_t l = k; l < count; ++l) {
      row += *form++ * w[l];
    }
    sum += row * w[k];
  }
  return sum;
}

static void lung_weights(const supine_basis *basis, size_t lung, const supine_pose *pose,
                         double *v) {
  const size_t modes = basis->info.mode_count;
  const size_t count = basis->info.normal_count;
  const size_t terms = supine_basis_normal_terms(basis);
  const double *gain = pose->gains[lung];
  const double *weights = supine_basis_lung_weights(basis, pose, lung);
  const double *form = basis->info.normal_weights + lung * count * 3 * terms;
  for (size_t j = 0; j < count; ++j) {
    v[j] = 0;
    for (size_t axis = 0; axis < 3; ++axis) {
      v[j] += *form++;
      for (size_t side = 1; side <= 2; ++side) {
        double sum = 0;
        for (size_t k = 0; k < modes; ++k) {
          sum += *form++ * weights[k];
        }
        v[j] += gain[(axis + side) % 3] * sum;
      }
      v[j] += gain[(axis + 1) % 3] * gain[(axis + 2) % 3] * triangle(modes, form, weights);
      form += modes * (modes + 1) / 2;
    }
  }
}

supine_status supine_basis_normal_weights(const supine_basis *basis, const supine_pose *pose,
                                          double *normal_weights) {
  if (!supine_basis_has_pose(basis, pose)) {
    return SUPINE_ERROR_ARGUMENT;
  }
  for (size_t lung = 0; lung < basis->info.lung_count; ++lung) {
    lung_weights(basis, lung, pose, normal_weights + lung * basis->info.normal_count);
  }
  return SUPINE_OK;
}

/* Compute the factors by which the kernel supine_kernels.light multiplies the packed vectors of a
 * lung (supine_basis_info.normals): the weight of each vector times normal_unit(). */
static void weigh(const supine_basis *basis, size_t lung, const supine_pose *pose, float *scales) {
  double v[SUPINE_NORMAL_MODES_MAX];
  lung_weights(basis, lung, pose, v);
  for (size_t j = 0; j < basis->info.normal_count; ++j) {
    scales[j] = (float)(normal_unit() * v[j]);
  }
}

/* Compute the normals of vertices begin <= i < end, which may belong to several lungs. */
static void light(const supine_basis *basis, const supine_pose *pose, size_t begin, size_t end,
                  bool stream, float *normals) {
  const supine_target target = {.xyz = normals,
                                .stream = stream,
                                .prefetch = stream ? basis->prefetch : SUPINE_PREFETCH_NONE};
  float scales[SUPINE_NORMAL_MODES_MAX + 2] = {0}; /* factor of each vector, then 0 */
  for (size_t lung = 0; lung < basis->info.lung_count; ++lung) {
    const size_t first = basis->lung_begin[lung] > begin ? basis->lung_begin[lung] : begin;
    const size_t last = basis->lung_begin[lung + 1] < end ? basis->lung_begin[lung + 1] : end;
    if (first < last) {
      const supine_target here = supine_target_after(&target, first - begin);
      weigh(basis, lung, pose, scales);
      supine_deform_lung(basis->kernels->light, &basis->lit, scales, first, last, &here);
    }
  }
  supine_stream_fence(stream);
}

/* Write the position of a vertex: that in a range of positions, if it lies there. */
static void find_position(const supine_basis *basis, const supine_pose *pose, size_t vertex,
                          size_t begin, size_t end, const float *xyz, float position[3]) {
  if (xyz != NULL && vertex >= begin && vertex < end) {
    memcpy(position, xyz + 3 * (vertex - begin), 3 * sizeof *position);
  } else {
    (void)supine_deform_range(basis, pose, vertex, vertex + 1, position);
  }
}

/* Compute the normals of vertices begin <= i < end from the triangles, as supine_normals does.
 * @param xyz  [end - begin, 3] their positions, or NULL */
static void light_triangles(const supine_basis *basis, const supine_pose *pose, size_t begin,
                            size_t end, const float *xyz, float *normals) {
  memset(normals, 0, 3 * (end - begin) * sizeof *normals);
  for (size_t t = 0; t < basis->info.triangle_count; ++t) {
    const uint32_t *corner = basis->info.triangles + 3 * t;
    float p[3][3];
    bool touches = false;
    for (size_t j = 0; j < 3; ++j) {
      touches = touches || (corner[j] >= begin && corner[j] < end);
    }
    if (!touches) {
      continue;
    }
    for (size_t j = 0; j < 3; ++j) {
      find_position(basis, pose, corner[j], begin, end, xyz, p[j]);
    }
    float normal[3];
    supine_triangle_normal(p[0], p[1], p[2], normal);
    for (size_t j = 0; j < 3; ++j) {
      if (corner[j] >= begin && corner[j] < end) {
        float *sum = normals + 3 * (corner[j] - begin);
        for (size_t k = 0; k < 3; ++k) {
          sum[k] += normal[k];
        }
      }
    }
  }
  supine_normals_normalise(end - begin, normals);
}

supine_status supine_deform_lit_range(const supine_basis *basis, const supine_pose *pose,
                                      size_t begin, size_t end, float *xyz, float *normals) {
  if (!supine_basis_has_range(basis, pose, begin, end)) {
    return SUPINE_ERROR_ARGUMENT;
  }
  if (xyz != NULL) {
    (void)supine_deform_range(basis, pose, begin, end, xyz);
  }
  if (basis->info.normal_count > 0) {
    light(basis, pose, begin, end, basis->stream && end - begin > STREAM_RANGE, normals);
  } else {
    light_triangles(basis, pose, begin, end, xyz, normals);
  }
  return SUPINE_OK;
}

supine_status supine_deform_lit(const supine_basis *basis, const supine_pose *pose, float *xyz,
                                float *normals) {
  return supine_deform_lit_range(basis, pose, 0, basis->info.vertex_count, xyz, normals);
}
