/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute the states of a breath, frame after frame, and of a turn of the body. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sh/base/vec3.h"

#include "program/options/breath_frames.h"
#include "program/options/state_options.h"

/* Compute the direction 90 degrees from `from`, towards `to`. */
static void find_quarter(const breath_turn *turn, double quarter[3]) {
  static const double left[3] = {1.0, 0.0, 0.0};
  static const double back[3] = {0.0, 1.0, 0.0};
  const double *from = turn->from;
  double axis[3];
  supine_cross(from, turn->to, axis);
  const double sine = supine_length(axis);
  if (sine < 1e-9) { /* opposite */
    const double *over = fabs(from[2]) > 0.5 ? back : left;
    supine_cross(from, over, axis);
    if (supine_dot(axis, axis) < 1e-9) { /* from one side to the other: over the back */
      supine_cross(from, back, axis);
    }
  }
  const double length = supine_length(axis);
  const double unit[3] = {axis[0] / length, axis[1] / length, axis[2] / length};
  supine_cross(unit, from, quarter);
}

void supine_breath_turn_gravity(const breath_turn *turn, double time, double gravity[3]) {
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

supine_status supine_breath_turn_read(const char *text, void *turn, supine_error *error) {
  breath_turn *made = turn;
  char from[SUPINE_POSTURE_NAME_MAX];
  char to[SUPINE_POSTURE_NAME_MAX];
  char seconds[32];
  if (sscanf(text, "%47[^:]:%47[^:]:%31s", from, to, seconds) != 3) {
    return SUPINE_ERROR_ARGUMENT;
  }
  const size_t last = strlen(seconds) - 1;
  seconds[last] = seconds[last] == 's' ? '\0' : seconds[last];
  if (!supine_options_parse_number(seconds, &made->seconds) || !(made->seconds > 0.0)) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "'%s' needs a time above 0 s, as in supine:left:5s", text);
  }
  const supine_status status = supine_options_posture(from, made->from, error);
  return status == SUPINE_OK ? supine_options_posture(to, made->to, error) : status;
}

void supine_breath_frames_free(breath_frames *frames) {
  free(frames->time);
  *frames = (breath_frames){0};
}

supine_state supine_breath_state(const supine_basis *basis, const double gravity[3], double ml) {
  const bool known = supine_basis_get_info(basis)->has_rest;
  return (supine_state){.gravity = {gravity[0], gravity[1], gravity[2]},
                        .volume = {known ? SUPINE_VOLUME_REST : SUPINE_VOLUME_SCAN, ml}};
}

supine_status supine_breath_frames_pose(const breath_frames *frames, size_t t, supine_pose *pose,
                                        supine_error *error) {
  const supine_state state =
      supine_breath_state(frames->basis, frames->gravity + 3 * t, frames->above[t]);
  return supine_basis_pose(frames->basis, &state, pose, error);
}

/* Eight parameters: the basis, the breath, the turn, the frames. */
supine_status supine_breath_frames_create(const supine_basis *basis, const supine_pv *pv,
                                          const supine_pv_breath *breath, const breath_turn *turn,
                                          double rate, size_t count, breath_frames *frames,
                                          supine_error *error) {
  const size_t lungs = supine_basis_get_info(basis)->lung_count;
  *frames = (breath_frames){.basis = basis,
                            .count = count,
                            .lungs = lungs,
                            .time = malloc((5 + lungs) * count * sizeof(double))};
  if (frames->time == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu frames", count);
  }
  frames->above = frames->time + count;
  frames->gravity = frames->above + count;
  frames->volumes = frames->gravity + 3 * count;
  for (size_t t = 0; t < count; ++t) {
    frames->time[t] = (double)t / rate;
    supine_breath_turn_gravity(turn, frames->time[t], frames->gravity + 3 * t);
  }
  supine_status status =
      supine_breath_evaluate(pv, breath, count, frames->time, frames->above, NULL, error);
  for (size_t t = 0; t < count && status == SUPINE_OK; ++t) {
    supine_pose pose;
    supine_error cause;
    status = supine_breath_frames_pose(frames, t, &pose, &cause);
    if (status != SUPINE_OK) {
      return supine_error_set(error, status, "at %.3f s: %s", frames->time[t], cause.message);
    }
    supine_basis_volumes(basis, &pose, frames->volumes + t * lungs);
  }
  return status;
}
