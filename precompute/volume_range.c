/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Measure the volumes that the lungs of a basis can hold. */
#include "precompute/volume_range.h"

#include <string.h>

#include <supine/inputs.h>

#include "base/arena.h"
#include "base/parallel.h"
#include "mesh/mesh.h"
#include "runtime/checks.h"

enum { SAMPLES_MAX = 10000, HALVINGS = 7 };

typedef struct measuring {
  const supine_basis *basis;
  /* Every few triangles of each lung; vertices are counted from the first vertex of the lung. */
  supine_mesh samples[SUPINE_STATE_LUNGS_MAX];
  size_t vertices_max; /* largest number of vertices of a lung */
  float *xyz;          /* [threads, vertices_max, 3] workspace */
  double *moved;       /* [threads, vertices_max, 3] workspace */
  double *range;
} measuring;

/* Return whether a lung folds at a volume, mL; other lungs are at full inflation. */
static bool folds(const measuring *m, const double gravity[3], size_t lung, double volume,
                  size_t thread) {
  const supine_basis_info *info = supine_basis_get_info(m->basis);
  const size_t begin = info->lung_begin[lung];
  const size_t end = info->lung_begin[lung + 1];
  float *xyz = m->xyz + 3 * m->vertices_max * thread;
  double *moved = m->moved + 3 * m->vertices_max * thread;
  supine_state state = {.gravity = {gravity[0], gravity[1], gravity[2]},
                        .lung_count = info->lung_count};
  supine_pose pose;
  for (size_t i = 0; i < info->lung_count; ++i) {
    (void)strncpy(state.lungs[i].name, info->lung_names[i], SUPINE_STATE_NAME_SIZE - 1);
    state.lungs[i].volume.kind = i == lung ? SUPINE_VOLUME_ABSOLUTE : SUPINE_VOLUME_FULL;
    state.lungs[i].volume.ml = i == lung ? volume : 0.0;
  }
  if (supine_basis_pose(m->basis, &state, &pose, NULL) != SUPINE_OK ||
      supine_deform_range(m->basis, &pose, begin, end, xyz) != SUPINE_OK) {
    return true;
  }
  for (size_t i = 0; i < 3 * (end - begin); ++i) {
    moved[i] = (double)xyz[i];
  }
  const double share = supine_mesh_turned_over(&m->samples[lung], moved);
  return supine_input_judge(SUPINE_INPUT_FOLDS, share) == SUPINE_INPUT_REFUSED;
}

/* Return the volume farthest from full inflation, up to `end`, at which a lung does not fold. */
static double find_end(const measuring *m, const double gravity[3], size_t lung, double end,
                       size_t thread) {
  double good = supine_basis_get_info(m->basis)->reference_volume[lung];
  double bad = end;
  if (!folds(m, gravity, lung, end, thread)) {
    return end;
  }
  for (size_t i = 0; i < HALVINGS; ++i) {
    const double middle = 0.5 * (good + bad);
    if (folds(m, gravity, lung, middle, thread)) {
      bad = middle;
    } else {
      good = middle;
    }
  }
  return good;
}

static void measure_nodes(void *context, size_t begin, size_t end, size_t thread) {
  const measuring *m = context;
  const supine_basis_info *info = supine_basis_get_info(m->basis);
  for (size_t node = begin; node < end; ++node) {
    const double gravity[3] = {(double)(node % 3) - 1.0, (double)(node / 3 % 3) - 1.0,
                               (double)(node / 9) - 1.0};
    const bool none = gravity[0] == 0.0 && gravity[1] == 0.0 && gravity[2] == 0.0;
    for (size_t lung = 0; lung < info->lung_count; ++lung) {
      const double full = info->reference_volume[lung];
      const double least = supine_input_get(SUPINE_INPUT_VOLUME_LEAST)->refused * full;
      const double most = supine_input_get(SUPINE_INPUT_VOLUME_MOST)->refused * full;
      double *range = m->range + (node * info->lung_count + lung) * 2;
      range[0] = none ? full : find_end(m, gravity, lung, least, thread);
      range[1] = none ? full : find_end(m, gravity, lung, most, thread);
    }
  }
}

/* Sample the triangles of a lung, with its reference surface. */
static void take_sample(const supine_basis *basis, size_t lung, supine_arena *arena,
                        supine_mesh *taken) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  const uint32_t begin = (uint32_t)info->lung_begin[lung];
  const uint32_t end = (uint32_t)info->lung_begin[lung + 1];
  const size_t share = info->triangle_count * (end - begin) / info->vertex_count;
  const size_t stride = 1 + share / SAMPLES_MAX;
  double *vertices = supine_arena_take(arena, 3 * (size_t)(end - begin), sizeof *vertices);
  uint32_t *triangles = supine_arena_take(arena, 3 * info->triangle_count, sizeof *triangles);
  size_t count = 0;
  if (supine_arena_status(arena) != SUPINE_OK) {
    return;
  }
  for (size_t i = 0; i < 3 * (size_t)(end - begin); ++i) {
    vertices[i] = (double)info->vertices[3 * begin + i];
  }
  for (size_t t = 0; t < info->triangle_count; t += stride) {
    const uint32_t *corner = info->triangles + 3 * t;
    if (corner[0] >= begin && corner[0] < end) {
      for (size_t k = 0; k < 3; ++k) {
        triangles[3 * count + k] = corner[k] - begin;
      }
      ++count;
    }
  }
  *taken = (supine_mesh){end - begin, vertices, count, triangles};
}

supine_status supine_precompute_volume_range(const supine_basis *basis, double *range,
                                             supine_error *error) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  const size_t threads = supine_thread_count();
  SUPINE_ARENA arena = {0};
  measuring m = {.basis = basis, .range = range};
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    const size_t count = info->lung_begin[lung + 1] - info->lung_begin[lung];
    m.vertices_max = count > m.vertices_max ? count : m.vertices_max;
    take_sample(basis, lung, &arena, &m.samples[lung]);
  }
  m.xyz = supine_arena_take(&arena, threads * 3 * m.vertices_max, sizeof *m.xyz);
  m.moved = supine_arena_take(&arena, threads * 3 * m.vertices_max, sizeof *m.moved);
  SUPINE_TRY(supine_arena_check(&arena, error, "the range of volumes of %zu vertices",
                                info->vertex_count));
  supine_parallel_for(SUPINE_RANGE_NODES, 1, threads, measure_nodes, &m);
  return SUPINE_OK;
}
