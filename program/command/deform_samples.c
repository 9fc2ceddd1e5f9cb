/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Draw plausible lungs from the random field of the expected error. */
#include <math.h>
#include <string.h>

#include <supine/doubt.h>
#include <supine/safetensors.h>

#include "base/arena.h"
#include "base/number.h"
#include "base/text.h"
#include "program/command/deform_samples.h"
#include "program/options/command.h"
#include "program/options/inside.h"

/* The field of a state. `mend` is NULL if the basis has no surface of the lungs, or no doubt. */
typedef struct source {
  const supine_basis *basis;
  const supine_state *state;
  const supine_location *location;
  const supine_doubt *field;
  const supine_doubt_mend *mend;
  size_t seed, vertices;
  float *predicted; /* [vertices, 3] mm, from which samples deviate */
  /* Embedded points, which a file holds in the order in which they were embedded, as CSV files do;
   * all else is in the order of the basis, and `order` NULL. */
  supine_options_names names;
  supine_arena arena;
} source;

static void end(source *s) {
  supine_options_names_close(&s->names);
  supine_arena_free(&s->arena);
}

/* Prepare the members that `basis`, `state` and `seed` decide. */
static supine_status begin(source *s, supine_error *error) {
  const supine_doubt_task task = {
      .basis = s->basis, .state_count = 1, .states = s->state, .location = s->location};
  const size_t more = supine_doubt_mend_space(s->basis);
  double *space = supine_arena_take(&s->arena, supine_doubt_space(s->basis, 1), sizeof *space);
  double *mend = supine_arena_take(&s->arena, more, sizeof *mend);
  supine_pose pose;
  s->vertices = supine_basis_get_info(s->basis)->vertex_count;
  s->predicted = supine_arena_take(&s->arena, 3 * s->vertices, sizeof *s->predicted);
  SUPINE_TRY(supine_arena_check(&s->arena, error, "samples of %zu vertices", s->vertices));
  if (s->location != NULL) {
    float *sigma = supine_arena_take(&s->arena, s->vertices, sizeof *sigma);
    SUPINE_TRY(supine_arena_check(&s->arena, error, "%zu vertices", s->vertices));
    SUPINE_TRY(supine_locate_positions(s->location, s->basis, s->predicted, sigma, error));
  } else {
    SUPINE_TRY(supine_basis_pose(s->basis, s->state, &pose, error));
    (void)supine_deform(s->basis, &pose, s->predicted);
  }
  SUPINE_TRY(supine_doubt_prepare(&task, space, &s->field, error));
  return supine_doubt_mend_prepare(s->field, 0, mend, &s->mend, error);
}

static supine_status draw(const source *s, size_t index, float *xyz, supine_error *error) {
  SUPINE_TRY(supine_doubt_sample(s->field, 0, s->seed, index, xyz, error));
  return supine_doubt_mend_sample(s->mend, xyz, error);
}

supine_status supine_command_deform_sample(const supine_basis *basis, const supine_state *state,
                                           size_t seed, size_t index, float *deviation,
                                           supine_error *error) {
  SUPINE_FREED_BY(end) source s = {.basis = basis, .state = state, .seed = seed};
  SUPINE_TRY(begin(&s, error));
  SUPINE_TRY(draw(&s, index, deviation, error));
  for (size_t i = 0; i < 3 * s.vertices; ++i) {
    deviation[i] -= s.predicted[i];
  }
  return SUPINE_OK;
}

/* Return whether samples have the volumes of the state. Located lungs whose volume the points
 * decide differ in it. */
static bool holds_volumes(const source *s) {
  return s->mend != NULL &&
         (s->location == NULL || !(supine_location_get_info(s->location)->volume_error > 0.0));
}

/* Sort vertices [vertices, 3] from the order of the basis into that of the file. */
static void sort(const source *s, const float *xyz, float *sorted) {
  for (size_t i = 0; i < s->vertices; ++i) {
    const size_t from = s->names.order == NULL ? i : s->names.order[i];
    memcpy(sorted + 3 * i, xyz + 3 * from, 3 * sizeof *sorted);
  }
}

/* Write samples, with the triangles and names of their vertices. */
static supine_status save(const supine_deform_samples *wanted, const source *s,
                          const float *positions, supine_error *error) {
  const size_t n = s->vertices;
  SUPINE_ARENA arena = {0};
  float *predicted = supine_arena_take(&arena, n, 3 * sizeof *predicted);
  uint32_t *part = supine_arena_take(&arena, n, sizeof *part);
  supine_tensor tensors[5] = {{"positions", SUPINE_F32, 3, {wanted->count, n, 3}, positions},
                              {"predicted", SUPINE_F32, 2, {n, 3}, predicted}};
  static const char *const copied[] = {"triangles", "names", "part"};
  size_t count = 2;
  char seed[24];
  char state[160];
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu vertices", n));
  sort(s, s->predicted, predicted);
  for (size_t i = 0; i < sizeof copied / sizeof *copied; ++i) {
    const supine_tensor *own = supine_basis_tensor(s->basis, copied[i]);
    if (own != NULL) {
      tensors[count++] = *own;
    }
  }
  if (s->names.order != NULL) { /* the last tensor is then `part` */
    for (size_t i = 0; i < n; ++i) {
      part[i] = s->names.part[s->names.order[i]];
    }
    tensors[count - 1].data = part;
  }
  (void)snprintf(seed, sizeof seed, "%zu", s->seed);
  (void)supine_state_describe(s->state, state, sizeof state);
  const supine_metadata metadata[] = {
      {"format", "supine-samples"},
      {"version", "1"},
      {"units", "mm"},
      {"axes", "LPS"},
      {"state", state},
      {"seed", seed},
      {"frame", s->location != NULL ? "of the observations" : "of the scan"},
      {"volume", holds_volumes(s) ? "that of the state in every sample" : "not exact"}};
  return supine_safetensors_write(wanted->path, tensors, count, metadata,
                                  sizeof metadata / sizeof *metadata, error);
}

supine_status supine_command_deform_samples_check(const char *path, bool given,
                                                  supine_error *error) {
  const bool holds = path != NULL && supine_text_ends_in(path, ".safetensors");
  SUPINE_REFUSE_IF(given && !holds, error, SUPINE_ERROR_ARGUMENT,
                   "--samples needs -o FILE.safetensors: give it");
  SUPINE_REFUSE_IF(!given && holds, error, SUPINE_ERROR_ARGUMENT,
                   "%s: such files hold samples: give --samples N", path);
  return SUPINE_OK;
}

supine_status supine_command_deform_samples(const supine_deform_samples *wanted, double *distance,
                                            bool *held, supine_error *error) {
  SUPINE_FREED_BY(end)
  source s = {.basis = wanted->basis,
              .state = wanted->state,
              .location = wanted->location,
              .seed = wanted->seed};
  double square = 0.0;
  SUPINE_TRY(begin(&s, error));
  const char *content = supine_basis_metadata(s.basis, "content");
  if (content != NULL && strcmp(content, "points") == 0) {
    SUPINE_TRY(supine_options_names_open(s.basis, &s.names, error));
  }
  const size_t each = 3 * s.vertices;
  float *xyz = supine_arena_take(&s.arena, each, sizeof *xyz);
  float *positions = supine_arena_take(&s.arena, wanted->count, each * sizeof *positions);
  SUPINE_TRY(supine_arena_check(&s.arena, error,
                                "%zu samples of %zu vertices: draw fewer, with several seeds",
                                wanted->count, s.vertices));
  supine_options_signals_catch(true);
  SUPINE_FREED_BY(supine_options_progress_end)
  supine_progress progress = supine_options_progress_begin("samples");
  for (size_t i = 0; i < wanted->count; ++i) {
    SUPINE_TRY(draw(&s, i, xyz, error));
    sort(&s, xyz, positions + each * i);
    for (size_t e = 0; e < each; ++e) {
      square += pow((double)xyz[e] - (double)s.predicted[e], 2.0);
    }
    const bool goes_on =
        supine_options_progress_step(&progress, (double)(i + 1) / (double)wanted->count);
    SUPINE_REFUSE_IF(!goes_on, error, SUPINE_ERROR_INTERRUPTED, "interrupted: nothing was written");
  }
  *distance = sqrt(square / (double)(s.vertices * wanted->count));
  *held = holds_volumes(&s);
  return save(wanted, &s, positions, error);
}
