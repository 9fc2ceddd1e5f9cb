/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Volumes over time: a breath sampled once, and volumes that people or sensors give. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "program/stream/volume.h"

supine_status supine_stream_volume_breathe(supine_stream_volume *volume, const supine_pv *pv,
                                           const supine_pv_breath *breath, supine_error *error) {
  enum { COUNT = SUPINE_STREAM_BREATH_SAMPLES + 1 };
  double times[COUNT];
  const double period = 60.0 / breath->rate;
  for (size_t i = 0; i < COUNT; ++i) {
    times[i] = period * (double)i / SUPINE_STREAM_BREATH_SAMPLES;
  }
  const supine_status status =
      supine_breath_evaluate(pv, breath, COUNT, times, volume->breath, NULL, error);
  if (status == SUPINE_OK) {
    volume->breath[COUNT - 1] = volume->breath[0]; /* the next breath's first */
    volume->breathes = true;
    volume->period = period;
  }
  return status;
}

supine_status supine_stream_volume_fix(supine_stream_volume *volume, const char *text,
                                       supine_error *error) {
  supine_state state = {.gravity = {0.0, 1.0, 0.0}};
  const supine_status status = supine_state_parse_volume(text, &state, error);
  if (status == SUPINE_OK) {
    volume->breathes = false;
    volume->fixed = state;
  }
  return status;
}

supine_state supine_stream_volume_at(const supine_stream_volume *volume, const supine_basis *basis,
                                     const double gravity[3], double time) {
  if (!volume->breathes) {
    supine_state state = volume->fixed;
    memcpy(state.gravity, gravity, sizeof state.gravity);
    return state;
  }
  const double turns = time / volume->period;
  const double at = (turns - floor(turns)) * SUPINE_STREAM_BREATH_SAMPLES;
  const size_t i = (size_t)fmin(at, SUPINE_STREAM_BREATH_SAMPLES - 1);
  const double t = at - (double)i;
  return supine_breath_state(basis, gravity,
                             (1.0 - t) * volume->breath[i] + t * volume->breath[i + 1]);
}
