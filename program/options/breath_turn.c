/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute the direction of gravity while the body turns, and make a state of a given volume. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/arena.h"
#include "base/vec3.h"

#include "program/options/breath_turn.h"
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
    /* The state `scan` has the lungs before their collapse; the reference surface has its volume.
     */
    state.volume.kind = SUPINE_VOLUME_ABSOLUTE;
    for (size_t lung = 0; lung < info->lung_count; ++lung) {
      state.volume.ml += info->reference_volume[lung];
    }
  }
  return state;
}
