/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Measure the volumes that the lungs of a basis can hold. */
#include "precompute/volume_range.h"

#include <stdint.h>
#include <string.h>

#include <supine/inputs.h>

#include "base/arena.h"
#include "base/parallel.h"
#include "mesh/mesh.h"
#include "runtime/checks.h"

enum { SAMPLES_MAX = 10000, HALVINGS = 7 };

/* Every few triangles of a lung, with the vertices that they have. */
typedef struct sample {
  supine_mesh mesh;   /* in the reference; its memory is in an arena */
  const uint32_t *of; /* [mesh.vertex_count] vertex of the lung, counted from its first one */
} sample;

typedef struct measuring {
  const supine_basis *basis;
  sample samples[SUPINE_STATE_LUNGS_MAX];
  size_t vertices_max; /* largest number of vertices of a lung */
  size_t sampled_max;  /* largest number of vertices of a sample */
  float *xyz;          /* [threads, vertices_max, 3] workspace */
  double *moved;       /* [threads, sampled_max, 3] workspace */
  double *range;
} measuring;

/* Return whether a lung folds at a volume, mL; other lungs are at full inflation. */
static bool folds(const measuring *m, const double gravity[3], size_t lung, double volume,
                  size_t thread) {
  const supine_basis_info *info = supine_basis_get_info(m->basis);
  const size_t begin = info->lung_begin[lung];
  const size_t end = info->lung_begin[lung + 1];
  float *xyz = m->xyz + 3 * m->vertices_max * thread;
  double *moved = m->moved + 3 * m->sampled_max * thread;
  const sample *from = &m->samples[lung];
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
  for (size_t i = 0; i < from->mesh.vertex_count; ++i) {
    for (size_t k = 0; k < 3; ++k) {
      moved[3 * i + k] = (double)xyz[3 * from->of[i] + k];
    }
  }
  const double share = supine_mesh_turned_over(&from->mesh, moved);
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

/* Copy a corner of a triangle to the sample, if it is not there yet. Return its number there. */
static uint32_t add_vertex(const float *vertices, uint32_t vertex, uint32_t *number, uint32_t *of,
                           supine_mesh *taken) {
  if (number[vertex] == UINT32_MAX) {
    number[vertex] = (uint32_t)taken->vertex_count;
    of[taken->vertex_count] = vertex;
    for (size_t k = 0; k < 3; ++k) {
      taken->vertices[3 * taken->vertex_count + k] = (double)vertices[3 * (size_t)vertex + k];
    }
    ++taken->vertex_count;
  }
  return number[vertex];
}

/* Sample the triangles of a lung, with its reference surface. */
static void take_sample(const supine_basis *basis, size_t lung, supine_arena *arena,
                        sample *taken) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  const uint32_t begin = (uint32_t)info->lung_begin[lung];
  const uint32_t end = (uint32_t)info->lung_begin[lung + 1];
  const size_t share = info->triangle_count * (end - begin) / info->vertex_count;
  const size_t stride = 1 + share / SAMPLES_MAX;
  const size_t most = 1 + info->triangle_count / stride;
  uint32_t *number = supine_arena_take(arena, end - begin, sizeof *number);
  uint32_t *of = supine_arena_take(arena, end - begin, sizeof *of);
  supine_mesh *mesh = &taken->mesh;
  mesh->vertices = supine_arena_take(arena, 3 * (size_t)(end - begin), sizeof *mesh->vertices);
  mesh->triangles = supine_arena_take(arena, 3 * most, sizeof *mesh->triangles);
  if (supine_arena_status(arena) != SUPINE_OK) {
    return;
  }
  for (uint32_t i = 0; i < end - begin; ++i) {
    number[i] = UINT32_MAX;
  }
  for (size_t t = 0; t < info->triangle_count; t += stride) {
    const uint32_t *corner = info->triangles + 3 * t;
    if (corner[0] >= begin && corner[0] < end) {
      for (size_t k = 0; k < 3; ++k) {
        mesh->triangles[3 * mesh->triangle_count + k] =
            add_vertex(info->vertices + 3 * (size_t)begin, corner[k] - begin, number, of, mesh);
      }
      ++mesh->triangle_count;
    }
  }
  taken->of = of;
}

supine_status supine_precompute_volume_range(const supine_basis *basis, double *range,
                                             supine_error *error) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  const size_t threads = supine_thread_count();
  SUPINE_ARENA arena = {0};
  measuring m = {.basis = basis, .range = range};
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    const size_t count = info->lung_begin[lung + 1] - info->lung_begin[lung];
    take_sample(basis, lung, &arena, &m.samples[lung]);
    const size_t sampled = m.samples[lung].mesh.vertex_count;
    m.vertices_max = count > m.vertices_max ? count : m.vertices_max;
    m.sampled_max = sampled > m.sampled_max ? sampled : m.sampled_max;
  }
  m.xyz = supine_arena_take(&arena, threads * 3 * m.vertices_max, sizeof *m.xyz);
  m.moved = supine_arena_take(&arena, threads * 3 * m.sampled_max, sizeof *m.moved);
  SUPINE_TRY(supine_arena_check(&arena, error, "the range of volumes of %zu vertices",
                                info->vertex_count));
  supine_parallel_for(SUPINE_RANGE_NODES, 1, threads, measure_nodes, &m);
  return SUPINE_OK;
}
