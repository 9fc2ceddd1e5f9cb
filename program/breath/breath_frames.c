/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute the surfaces of a breath, frame after frame. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sh/base/clock.h"

#include "program/breath/breath_frames.h"

enum { RUN_MAX = 128 }; /* largest number of steps of a run */

static const double tolerance = 0.01; /* largest error of a volume within a run, mL */

void supine_breath_frames_free(breath_frames *frames) {
  free(frames->time);
  free(frames->gains);
  free(frames->run);
  free(frames->step);
  *frames = (breath_frames){0};
}

supine_state supine_breath_state(const supine_basis *basis, const double gravity[3], double ml) {
  const bool known = supine_basis_get_info(basis)->has_rest;
  return (supine_state){.gravity = {gravity[0], gravity[1], gravity[2]},
                        .volume = {known ? SUPINE_VOLUME_REST : SUPINE_VOLUME_SCAN, ml}};
}

/* Compute the pose of a frame from its orientation and volume. */
static supine_status pose_frame(const breath_frames *frames, size_t t, supine_pose *pose,
                                supine_error *error) {
  const supine_state state =
      supine_breath_state(frames->basis, frames->gravity + 3 * t, frames->above[t]);
  return supine_basis_pose(frames->basis, &state, pose, error);
}

static supine_status find_gains(breath_frames *frames, supine_error *error) {
  for (size_t t = 0; t < frames->count; ++t) {
    supine_pose pose;
    supine_error cause;
    const supine_status status = pose_frame(frames, t, &pose, &cause);
    if (status != SUPINE_OK) {
      return supine_error_set(error, status, "at %.3f s: %s", frames->time[t], cause.message);
    }
    memcpy(frames->gains[t], pose.gains, sizeof pose.gains);
    supine_basis_volumes(frames->basis, &pose, frames->volumes + t * frames->lungs);
  }
  return SUPINE_OK;
}

/* Mix the gains of two frames: gains = first + share (last - first). */
static void mix_gains(const breath_frames *frames, size_t first, size_t last, double share,
                      double (*gains)[3]) {
  for (size_t i = 0; i < 3 * frames->lungs; ++i) {
    const double a = frames->gains[first][i / 3][i % 3];
    const double b = frames->gains[last][i / 3][i % 3];
    gains[i / 3][i % 3] = a + share * (b - a);
  }
}

/* Compute the volumes of frame t in a run of equal steps from `first` to `last`. */
static void stepped_volumes(const breath_frames *frames, supine_pose *pose, size_t first,
                            size_t last, size_t t, double *volumes) {
  mix_gains(frames, first, last, (double)(t - first) / (double)(last - first), pose->gains);
  supine_basis_volumes(frames->basis, pose, volumes);
}

/* Return whether equal steps from frame `first` to `last` keep the volumes of the frames between
 * within the tolerance. */
static bool run_holds(const breath_frames *frames, supine_pose *pose, size_t first, size_t last) {
  const size_t lungs = frames->lungs;
  for (size_t t = first + 1; t < last; ++t) {
    double volumes[SUPINE_LUNGS_MAX];
    double off = 0.0;
    stepped_volumes(frames, pose, first, last, t, volumes);
    for (size_t lung = 0; lung < lungs; ++lung) {
      off += volumes[lung] - frames->volumes[t * lungs + lung];
    }
    if (fabs(off) > tolerance) {
      return false;
    }
  }
  return true;
}

/* Find runs greedily, and replace the gains and volumes within a run by those of equal steps. A
 * basis with rigid parts has no runs, as rotations are not equal steps. */
static void find_runs(breath_frames *frames) {
  supine_pose pose;
  for (size_t t = 0; t < frames->count; ++t) {
    frames->run[t] = t;
  }
  if (!frames->fixed || supine_basis_tensor(frames->basis, "rigid") != NULL ||
      supine_basis_weights(frames->basis, frames->gravity, pose.weights) != SUPINE_OK) {
    return;
  }
  size_t first = 0;
  while (first < frames->count) {
    size_t last = first;
    while (last + 1 < frames->count && last - first < RUN_MAX &&
           run_holds(frames, &pose, first, last + 1)) {
      ++last;
    }
    if (last == first + 1) { /* a run of one step costs more than evaluating its frame */
      last = first;
    }
    for (size_t t = first + 1; t <= last; ++t) {
      frames->run[t] = first;
      stepped_volumes(frames, &pose, first, last, t, frames->volumes + t * frames->lungs);
      ++frames->stepped;
    }
    if (last > first) { /* the second frame takes the gains one step after the first */
      mix_gains(frames, first, last, 1.0 / (double)(last - first), frames->gains[first + 1]);
    }
    first = last + 1;
  }
}

/* Eight parameters: the basis, the breath, the turn, the frames. */
supine_status supine_breath_frames_create(const supine_basis *basis, const supine_pv *pv,
                                          const supine_pv_breath *breath, const breath_turn *turn,
                                          double rate, size_t count, breath_frames *frames,
                                          supine_error *error) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  *frames = (breath_frames){.basis = basis,
                            .count = count,
                            .lungs = info->lung_count,
                            .fixed = turn->seconds == 0.0,
                            .time = malloc((5 + info->lung_count) * count * sizeof(double)),
                            .gains = malloc(count * sizeof *frames->gains),
                            .run = malloc(count * sizeof *frames->run),
                            .step = malloc(3 * info->vertex_count * sizeof *frames->step)};
  if (frames->time == NULL || frames->gains == NULL || frames->run == NULL ||
      frames->step == NULL) {
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
  if (status == SUPINE_OK) {
    status = find_gains(frames, error);
  }
  if (status == SUPINE_OK) {
    find_runs(frames);
  }
  return status;
}

/* Compute a frame from its orientation and volume, and the step of the run that it begins. */
static void place(breath_frames *frames, size_t t, float *xyz) {
  supine_pose pose;
  (void)pose_frame(frames, t, &pose, NULL); /* the pose was computed before, so this cannot fail */
  supine_deform(frames->basis, &pose, xyz);
  if (t + 1 < frames->count && frames->run[t + 1] == t) { /* a run begins */
    for (size_t i = 0; i < 3 * frames->lungs; ++i) {
      pose.gains[i / 3][i % 3] =
          frames->gains[t + 1][i / 3][i % 3] - frames->gains[t][i / 3][i % 3];
    }
    supine_displace_range(frames->basis, &pose, 0,
                          supine_basis_get_info(frames->basis)->vertex_count, frames->step);
  }
}

double supine_breath_frames_next(breath_frames *frames, float *xyz) {
  const size_t t = frames->next++;
  const double begin = supine_clock_seconds();
  if (frames->run[t] == t) {
    place(frames, t, xyz);
  } else {
    supine_step(supine_basis_get_info(frames->basis)->vertex_count, frames->step, xyz);
  }
  return supine_clock_seconds() - begin;
}
