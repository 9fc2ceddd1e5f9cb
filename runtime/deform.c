/* SPDX-License-Identifier: MIT */
/* Compute deformed positions. One call of a kernel evaluates many tiles of 16 vertices. */
#include <string.h>

#include "runtime/clusters.h"
#include "runtime/rigid.h"

/* Compute the numbers by which a kernel multiplies packed numbers of a lung: for each mode, the
 * weight times the quantisation steps (supine_basis.mode_scale), and then the factors of the lung's
 * displacement along x, y and z.
 * @param scales  [modes + 3], written */
static void weigh(const supine_basis *basis, const supine_pose *pose, size_t lung, float *scales) {
  const size_t modes = basis->info.mode_count;
  const double *weights = supine_basis_lung_weights(basis, pose, lung);
  for (size_t k = 0; k < modes; ++k) {
    scales[k] = (float)(weights[k] * basis->mode_scale[k]);
  }
  for (size_t axis = 0; axis < 3; ++axis) {
    scales[modes + axis] = (float)pose->gains[lung][axis];
  }
}

supine_target supine_target_after(const supine_target *target, size_t count) {
  supine_target moved = *target;
  moved.xyz += 3 * count;
  return moved;
}

/* Evaluate one tile into a buffer, and copy the vertices begin <= i < end of this tile. */
static void deform_part(supine_deform_tiles *kernel, const supine_tiles *tiles, const float *scales,
                        size_t begin, size_t end, const supine_target *target) {
  float aside[TILE_NUMBERS];
  const supine_target whole = {.xyz = aside, .add_reference = target->add_reference};
  kernel(tiles, scales, begin / TILE, 1, &whole);
  memcpy(target->xyz, aside + 3 * (begin % TILE), 3 * (end - begin) * sizeof *aside);
}

void supine_deform_lung(supine_deform_tiles *kernel, const supine_tiles *tiles, const float *scales,
                        size_t begin, size_t end, const supine_target *target) {
  size_t at = begin;
  while (at < end) {
    const supine_target here = supine_target_after(target, at - begin);
    const size_t whole = at % TILE == 0 ? (end - at) / TILE : 0;
    if (whole > 0) {
      kernel(tiles, scales, at / TILE, whole, &here);
      at += whole * TILE;
    } else {
      const size_t next = (at / TILE + 1) * TILE;
      const size_t last = next < end ? next : end;
      deform_part(kernel, tiles, scales, at, last, &here);
      at = last;
    }
  }
}

/* Evaluate vertices begin <= i < end of a basis of clusters, of which each belongs to one lung. */
static void deform_clusters(const supine_basis *basis, const supine_pose *pose, size_t begin,
                            size_t end, const supine_target *target) {
  supine_cluster_frames frames;
  supine_clusters_pose(basis, pose, begin, end, frames);
  supine_deform_lung(basis->kernels->cluster, &basis->tiles, frames, begin, end, target);
}

/* Evaluate vertices begin <= i < end of all lungs as the modes move them. */
static void deform_by_modes(const supine_basis *basis, const supine_pose *pose, size_t begin,
                            size_t end, const supine_target *target) {
  float scales[SUPINE_MODES_MAX + 3];
  if (basis->info.cluster_count > 0) {
    deform_clusters(basis, pose, begin, end, target);
    return;
  }
  for (size_t lung = 0; lung < basis->info.lung_count; ++lung) {
    const size_t first = basis->lung_begin[lung] > begin ? basis->lung_begin[lung] : begin;
    const size_t last = basis->lung_begin[lung + 1] < end ? basis->lung_begin[lung + 1] : end;
    if (first < last) {
      const supine_target here = supine_target_after(target, first - begin);
      weigh(basis, pose, lung, scales);
      supine_deform_lung(basis->kernels->deform, &basis->tiles, scales, first, last, &here);
    }
  }
}

/* Stretch the lungs about their hila by 1 + pose->expansion, at vertices begin <= i < end. */
static void expand_lungs(const supine_basis *basis, const supine_pose *pose, size_t begin,
                         size_t end, const supine_target *target) {
  for (size_t lung = 0; lung < basis->info.lung_count; ++lung) {
    const double by = pose->expansion[lung];
    const double *hilum = basis->hilum[lung];
    const size_t first = basis->lung_begin[lung] > begin ? basis->lung_begin[lung] : begin;
    const size_t last = basis->lung_begin[lung + 1] < end ? basis->lung_begin[lung + 1] : end;
    for (size_t i = first; i < last; ++i) {
      for (size_t a = 0; a < 3; ++a) {
        float *x = target->xyz + 3 * (i - begin) + a;
        const double reference = (double)basis->info.vertices[3 * i + a];
        const double at = (double)*x + (target->add_reference ? 0 : reference);
        *x = (float)((double)*x + by * (at - hilum[a]));
      }
    }
  }
}

/* Evaluate vertices begin <= i < end of all lungs as if no part were rigid. */
static void deform_lungs(const supine_basis *basis, const supine_pose *pose, size_t begin,
                         size_t end, const supine_target *target) {
  deform_by_modes(basis, pose, begin, end, target);
  if (supine_basis_expansion(basis, pose) > 0) {
    expand_lungs(basis, pose, begin, end, target);
  }
}

enum { RIGID_BLOCK = 256 };

/* Overwrite the positions or displacements of the vertices begin <= i < end that belong to rigid
 * parts. Each part moves by its rigid motion (rigid.h). */
static void deform_rigid(const supine_basis *basis, const supine_pose *pose, size_t begin,
                         size_t end, const supine_target *target) {
  for (size_t part = 0; part < basis->rigid_count; ++part) {
    const size_t first = basis->rigid[2 * part];
    const size_t last = basis->rigid[2 * part + 1];
    supine_rigid_motion m = {.count = 0};
    if (first >= end || last <= begin) {
      continue;
    }
    for (size_t at = first; at < last; at += RIGID_BLOCK) {
      float x[3 * RIGID_BLOCK];
      const size_t next = last - at < RIGID_BLOCK ? last : at + RIGID_BLOCK;
      const supine_target block = {.xyz = x, .add_reference = true};
      deform_lungs(basis, pose, at, next, &block);
      supine_rigid_add(&m, basis->info.vertices + 3 * at, x, next - at);
    }
    supine_rigid_finish(&m);
    for (size_t i = first > begin ? first : begin; i < last && i < end; ++i) {
      const float *p = basis->info.vertices + 3 * i;
      for (size_t a = 0; a < 3; ++a) {
        const double value =
            supine_rigid_move(&m, p, a) - (target->add_reference ? 0 : (double)p[a]);
        target->xyz[3 * (i - begin) + a] = (float)value;
      }
    }
  }
}

static supine_status deform_range(const supine_basis *basis, const supine_pose *pose, size_t begin,
                                  size_t end, supine_target target) {
  if (!supine_basis_has_range(basis, pose, begin, end)) {
    return SUPINE_ERROR_ARGUMENT;
  }
  target.stream = basis->stream && end - begin > STREAM_RANGE;
  target.prefetch = basis->prefetch;
  deform_lungs(basis, pose, begin, end, &target);
  supine_stream_fence(target.stream);
  deform_rigid(basis, pose, begin, end, &target);
  return SUPINE_OK;
}

supine_status supine_deform_range(const supine_basis *basis, const supine_pose *pose, size_t begin,
                                  size_t end, float *xyz) {
  return deform_range(basis, pose, begin, end, (supine_target){.xyz = xyz, .add_reference = true});
}

supine_status supine_deform(const supine_basis *basis, const supine_pose *pose, float *xyz) {
  return supine_deform_range(basis, pose, 0, basis->info.vertex_count, xyz);
}

supine_status supine_deform_strided(const supine_basis *basis, const supine_pose *pose,
                                    size_t begin, size_t end, size_t stride, void *positions) {
  enum { BLOCK = 1024 };
  float xyz[3 * BLOCK];
  const size_t bytes = 3 * sizeof *xyz;
  if (stride < bytes || !supine_basis_has_range(basis, pose, begin, end)) {
    return SUPINE_ERROR_ARGUMENT;
  }
  for (size_t at = begin; at < end; at += BLOCK) {
    const size_t count = end - at < BLOCK ? end - at : BLOCK;
    (void)supine_deform_range(basis, pose, at, at + count, xyz);
    for (size_t i = 0; i < count; ++i) {
      memcpy((unsigned char *)positions + (at - begin + i) * stride, xyz + 3 * i, bytes);
    }
  }
  return SUPINE_OK;
}

supine_status supine_deform_batch(const supine_basis *basis, size_t count, const supine_pose *poses,
                                  size_t begin, size_t end, float *xyz) {
  enum { BLOCK_BYTES = 1 << 18 }; /* bytes of packed vertices, few enough for the cache */
  const size_t block = BLOCK_BYTES / basis->tiles.stride * TILE;
  const size_t apart = 3 * (end - begin);
  supine_target target = {.add_reference = true,
                          .stream =
                              (double)count * (double)apart * sizeof *xyz > STREAM_BATCH_BYTES};
  for (size_t j = 0; j < count; ++j) {
    if (!supine_basis_has_range(basis, &poses[j], begin, end)) {
      return SUPINE_ERROR_ARGUMENT;
    }
  }
  for (size_t at = begin, next; at < end; at = next) {
    next = (at / block + 1) * block < end ? (at / block + 1) * block : end;
    for (size_t j = 0; j < count; ++j) {
      target.xyz = xyz + j * apart + 3 * (at - begin);
      deform_lungs(basis, &poses[j], at, next, &target);
    }
  }
  supine_stream_fence(target.stream);
  for (size_t j = 0; j < count; ++j) {
    target.xyz = xyz + j * apart;
    deform_rigid(basis, &poses[j], begin, end, &target);
  }
  return SUPINE_OK;
}

supine_status supine_displace_range(const supine_basis *basis, const supine_pose *pose,
                                    size_t begin, size_t end, float *xyz) {
  return deform_range(basis, pose, begin, end, (supine_target){.xyz = xyz});
}

void supine_step(size_t count, const float *restrict step, float *restrict xyz) {
  for (size_t i = 0; i < 3 * count; ++i) {
    xyz[i] += step[i];
  }
}
