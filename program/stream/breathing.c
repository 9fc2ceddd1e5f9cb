/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute the volume of the lungs at a time: a fixed one, or rest in the posture plus a breath. */
#include <string.h>

#include "program/stream/breathing.h"

supine_status supine_stream_volume_breathe(supine_stream_volume *volume, const supine_pv *pv,
                                           const supine_pv_breath *breath, supine_error *error) {
  const double start = 0.0;
  double above = 0.0;
  const supine_status status =
      supine_breath_evaluate(pv, breath, 1, &start, &above, NULL, error); /* checks both */
  if (status == SUPINE_OK) {
    *volume = (supine_stream_volume){.breathes = true, .pv = *pv, .breath = *breath};
  }
  return status;
}

supine_status supine_stream_volume_fix(supine_stream_volume *volume, const char *text,
                                       supine_error *error) {
  supine_state state = {.gravity = {0.0, 1.0, 0.0}};
  const supine_status status = supine_state_parse_volume(text, &state, error);
  if (status == SUPINE_OK) {
    *volume = (supine_stream_volume){.fixed = state};
  }
  return status;
}

supine_state supine_stream_volume_at(const supine_stream_volume *volume, const supine_basis *basis,
                                     const double gravity[3], double time) {
  double above = 0.0;
  if (volume->breathes) {
    (void)supine_breath_evaluate(&volume->pv, &volume->breath, 1, &time, &above, NULL,
                                 NULL); /* was checked */
    return supine_breath_state(basis, gravity, above);
  }
  supine_state state = volume->fixed;
  memcpy(state.gravity, gravity, sizeof state.gravity);
  return state;
}
