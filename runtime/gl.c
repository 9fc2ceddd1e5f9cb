/* SPDX-License-Identifier: MIT */
#include <string.h>

#include "base/arena.h"
#include "runtime/clusters.h"
#include "runtime/internal.h"
#include "runtime/kernels/compact.h"
#include "runtime/lung.h"

_Static_assert((int)SUPINE_GL_FRAME_FLOATS == (int)SUPINE_CLUSTER_FRAME,
               "the texture has whole frames");
_Static_assert(sizeof(supine_gl_clustered_vertex) == 20, "the members are packed");

/* Return whether vertices move by modes, not by clusters, and by no more than the shader holds. */
static bool fits(const supine_basis *basis) {
  return basis->info.mode_count <= SUPINE_GL_MODES && basis->info.cluster_count == 0;
}

supine_status supine_gl_pack(const supine_basis *basis, size_t begin, size_t end,
                             float *attributes) {
  const bool vector = basis->info.vector;
  const size_t head = vector ? SUPINE_GL_VECTOR_FLOATS : SUPINE_GL_FLOATS;
  const size_t count = (vector ? 3 : 1) * basis->info.mode_count;
  if (!fits(basis)) {
    return SUPINE_ERROR_UNSUPPORTED;
  }
  for (size_t i = begin; i < end; ++i) {
    float *to = attributes + (i - begin) * (head + count);
    memcpy(to, basis->info.vertices + 3 * i, 3 * sizeof *to);
    to[3] = (float)supine_basis_lung_of(&basis->info, i);
    if (!vector) {
      memcpy(to + 4, basis->info.direction + 3 * i, 3 * sizeof *to);
    }
    memcpy(to + head, basis->info.coefficients + i * count, count * sizeof *to);
  }
  return SUPINE_OK;
}

supine_status supine_gl_weights(const supine_basis *basis, const supine_pose *pose, float *weights,
                                float *gains) {
  const size_t modes = basis->info.mode_count;
  const size_t stride = (modes + 3) / 4 * 4;
  const size_t rows = basis->info.order > 0 ? basis->info.lung_count : 1;
  if (basis->info.cluster_count > 0) {
    return SUPINE_ERROR_UNSUPPORTED;
  }
  if (!supine_basis_has_pose(basis, pose)) {
    return SUPINE_ERROR_ARGUMENT;
  }
  if (supine_basis_expansion(basis, pose) > 0) {
    return SUPINE_ERROR_UNSUPPORTED;
  }
  for (size_t i = 0; i < rows * stride; ++i) {
    const double *of = supine_basis_lung_weights(basis, pose, i / stride);
    weights[i] = i % stride < modes ? (float)of[i % stride] : 0;
  }
  for (size_t i = 0; i < 3 * basis->info.lung_count; ++i) {
    gains[i] = (float)pose->gains[i / 3][i % 3];
  }
  return SUPINE_OK;
}

supine_status supine_gl_pack_clusters(const supine_basis *basis, size_t begin, size_t end,
                                      supine_gl_clustered_vertex *vertices) {
  const supine_basis_info *info = &basis->info;
  if (info->cluster_count == 0) {
    return SUPINE_ERROR_UNSUPPORTED;
  }
  for (size_t i = begin; i < end; ++i) {
    supine_gl_clustered_vertex *to = vertices + (i - begin);
    memcpy(to->reference, info->vertices + 3 * i, sizeof to->reference);
    memcpy(to->scalars, info->cluster_scalars + 2 * i, sizeof to->scalars);
    to->cluster = info->cluster[i];
    to->lung = basis->cluster_lung[to->cluster];
  }
  return SUPINE_OK;
}

supine_status supine_gl_frames(const supine_basis *basis, const supine_pose *pose, float *frames) {
  const supine_basis_info *info = &basis->info;
  if (info->cluster_count == 0) {
    return SUPINE_ERROR_UNSUPPORTED;
  }
  if (!supine_basis_has_pose(basis, pose)) {
    return SUPINE_ERROR_ARGUMENT;
  }
  /* A cluster without vertices has no frame. */
  memset(frames, 0, info->cluster_count * SUPINE_GL_FRAME_FLOATS * sizeof *frames);
  supine_clusters_pose(basis, pose, 0, info->vertex_count, frames);
  return SUPINE_OK;
}

supine_status supine_gl_pack_normals(const supine_basis *basis, size_t begin, size_t end,
                                     uint32_t *words) {
  const size_t count = supine_tiles_normal_words(basis->info.normal_count);
  if (count == 0) {
    return SUPINE_ERROR_UNSUPPORTED;
  }
  for (size_t i = begin; i < end; ++i) {
    const unsigned char *tile = basis->lit.bytes + i / TILE * basis->lit.stride;
    for (size_t j = 0; j < 3 * count; ++j) {
      const size_t row = j % 3 * count + j / 3;
      memcpy(words++, tile + (row * TILE + i % TILE) * sizeof *words, sizeof *words);
    }
  }
  return SUPINE_OK;
}

supine_status supine_gl_normal_weights(const supine_basis *basis, const supine_pose *pose,
                                       float *uniforms) {
  const size_t modes = basis->info.normal_count;
  const size_t words = supine_tiles_normal_words(modes);
  double v[SUPINE_LUNGS_MAX * SUPINE_NORMAL_MODES_MAX];
  if (words == 0) {
    return SUPINE_ERROR_UNSUPPORTED;
  }
  SUPINE_TRY(supine_basis_normal_weights(basis, pose, v));
  memset(uniforms, 0, 3 * words * basis->info.lung_count * sizeof *uniforms);
  for (size_t lung = 0; lung < basis->info.lung_count; ++lung) {
    for (size_t j = 0; j < modes; ++j) {
      uniforms[3 * (lung * words + j % words) + j / words] =
          (float)(normal_unit() * v[lung * modes + j]);
    }
  }
  return SUPINE_OK;
}
