/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute the surfaces of a breath, frame after frame. */
#include <stdlib.h>

#include "program/breath/breath_frames.h"

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
