/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute the states of a breath, in one posture or while the body turns. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/arena.h"
#include "base/vec3.h"

#include "precompute/posed/posed.h"
#include "program/options/breath_turn.h"
#include "program/options/pv.h"
#include "program/options/state_options.h"

/* Compute the unit vector perpendicular to `from` in the plane of the turn, towards `to`. */
static void find_quarter(const breath_turn *turn, double quarter[3]) {
  static const double left[3] = {1.0, 0.0, 0.0};
  static const double back[3] = {0.0, 1.0, 0.0};
  const double *from = turn->from;
  double axis[3];
  supine_cross(from, turn->to, axis);
  if (supine_length(axis) < 1e-9) { /* opposite directions do not determine the axis of the turn */
    const bool over_back = fabs(from[2]) > 0.5 || fabs(from[0]) > 1.0 - 1e-9;
    supine_cross(from, over_back ? back : left, axis);
  }
  (void)supine_normalise(axis, axis);
  supine_cross(axis, from, quarter);
}

void supine_options_turn_gravity(const breath_turn *turn, double time, double gravity[3]) {
  const double cosine = fmax(-1.0, fmin(1.0, supine_dot(turn->from, turn->to)));
  if (time >= turn->seconds || cosine > 1.0 - 1e-15) {
    memcpy(gravity, turn->to, 3 * sizeof *gravity);
    return;
  }
  double quarter[3];
  find_quarter(turn, quarter);
  const double angle = acos(cosine) * fmax(0.0, time / turn->seconds);
  for (size_t k = 0; k < 3; ++k) {
    gravity[k] = cos(angle) * turn->from[k] + sin(angle) * quarter[k];
  }
}

double supine_options_frame_count(double seconds, double fps) {
  return floor(seconds * fps * (1.0 + 1e-12)) + 1.0;
}

supine_status supine_options_turn_read(const char *text, void *turn, supine_error *error) {
  breath_turn *made = turn;
  char from[SUPINE_POSTURE_NAME_MAX];
  char to[SUPINE_POSTURE_NAME_MAX];
  char seconds[32];
  if (sscanf(text, "%47[^:]:%47[^:]:%31s", from, to, seconds) != 3) {
    return SUPINE_ERROR_ARGUMENT;
  }
  const supine_status status =
      supine_quantity_parse(seconds, SUPINE_QUANTITY_TIME, 1, &made->seconds, NULL);
  SUPINE_REFUSE_IF(status != SUPINE_OK || !(made->seconds > 0.0), error, SUPINE_ERROR_ARGUMENT,
                   "'%s': the time must be above 0 s, as in supine:left:5s", text);
  supine_state state[2] = {{.lung_count = 0}};
  SUPINE_TRY(supine_state_parse_posture(from, &state[0], error));
  SUPINE_TRY(supine_state_parse_posture(to, &state[1], error));
  memcpy(made->from, state[0].gravity, sizeof made->from);
  memcpy(made->to, state[1].gravity, sizeof made->to);
  return SUPINE_OK;
}

supine_state supine_options_breath_state(const supine_basis *basis, const double gravity[3],
                                         double ml) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  supine_state state = {.gravity = {gravity[0], gravity[1], gravity[2]},
                        .volume = {SUPINE_VOLUME_REST, ml}};
  if (!info->has_rest) {
    state.volume.kind = SUPINE_VOLUME_SCAN;
  }
  if (!info->has_rest && info->hilum != NULL) {
    /* The state `scan` has the lungs before their collapse; the reference surface has its
     * volume. */
    state.volume.kind = SUPINE_VOLUME_ABSOLUTE;
    for (size_t lung = 0; lung < info->lung_count; ++lung) {
      state.volume.ml += info->reference_volume[lung];
    }
  }
  return state;
}

supine_status supine_options_breath_lie(const supine_state *posture, supine_options_breath *breath,
                                        supine_error *error) {
  SUPINE_REFUSE_IF(posture->volume.kind != SUPINE_VOLUME_DEFAULT || posture->lung_count > 0, error,
                   SUPINE_ERROR_ARGUMENT,
                   "a breath starts at rest: give --posture without a volume");
  memcpy(breath->turn.to, posture->gravity, sizeof breath->turn.to);
  memcpy(breath->turn.from, posture->gravity, sizeof breath->turn.from);
  return SUPINE_OK;
}

/* Compute the pose of each frame, and set `end` to the frames of smallest and of largest volume. */
static supine_status find_ends(const supine_basis *basis, const supine_options_breath *breath,
                               const double *time, const supine_state *state, size_t end[2],
                               supine_error *error) {
  double most[2] = {-INFINITY, -INFINITY}; /* of -volume and of volume, mL */
  for (size_t t = 0; t < breath->count; ++t) {
    supine_pose pose;
    supine_error cause;
    if (supine_basis_pose(basis, &state[t], &pose, &cause) != SUPINE_OK) {
      return supine_error_wrap(error, &cause, "frame at %.3f s: ", time[t]);
    }
    const double volume = supine_posed_volume(basis, &pose);
    for (size_t i = 0; i < 2; ++i) {
      const double above = i == 0 ? -volume : volume;
      if (above > most[i]) {
        most[i] = above;
        end[i] = t;
      }
    }
  }
  return SUPINE_OK;
}

supine_status supine_options_breath_list(const supine_basis *basis, const char *command,
                                         const supine_options_breath *breath, double *time,
                                         supine_state *state, supine_error *error) {
  supine_pv pv = *supine_breath_normal();
  size_t end[2] = {0, 0};
  SUPINE_ARENA arena = {0};
  double *above = supine_arena_take(&arena, breath->count, sizeof *above);
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu frames", breath->count));
  if (breath->pv != NULL) {
    SUPINE_TRY(supine_options_pv_load(breath->pv, &pv, error));
  }
  for (size_t t = 0; t < breath->count; ++t) {
    time[t] = (double)t / breath->fps;
  }
  SUPINE_TRY(supine_breath_evaluate(&pv, &breath->cycle, breath->count, time, above, NULL, error));
  for (size_t t = 0; t < breath->count; ++t) {
    double gravity[3];
    supine_options_turn_gravity(&breath->turn, time[t], gravity);
    state[t] = supine_options_breath_state(basis, gravity, above[t]);
  }
  SUPINE_TRY(find_ends(basis, breath, time, state, end, error));
  for (size_t i = 0; i < 2; ++i) {
    supine_pose pose;
    SUPINE_TRY(supine_options_pose(basis, command, &state[end[i]], &pose, error));
  }
  return SUPINE_OK;
}
