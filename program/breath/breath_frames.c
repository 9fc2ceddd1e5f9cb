/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The surfaces of a breath, frame after frame. */
#include <math.h>
#include <stdlib.h>

#include "sh/base/clock.h"
#include <supine/volume.h>

#include "program/breath/breath_frames.h"

enum { RUN_MAX = 128 };

static const double tolerance = 0.01; /* mL, of the frames of a run */

struct breath_frames {
  const supine_basis *basis;
  const breath_course *course;
  double *scale;   /* [T] */
  double *volumes; /* [T, G] mL */
  size_t *run;     /* [T] first frame of each frame's run */
  float *step;     /* [N, 3] mm, of the present run */
  size_t next;
  size_t stepped;
};

void supine_breath_frames_destroy(breath_frames *frames) {
  if (frames != NULL) {
    free(frames->scale);
    free(frames->volumes);
    free(frames->run);
    free(frames->step);
    free(frames);
  }
}

static supine_status find_scales(breath_frames *frames, supine_error *error) {
  const breath_course *course = frames->course;
  for (size_t t = 0; t < course->count; ++t) {
    double weights[SUPINE_MODES_MAX];
    supine_error cause = {SUPINE_OK, "gravity has no direction"};
    supine_status status = supine_basis_weights(frames->basis, course->gravity + 3 * t, weights);
    if (status == SUPINE_OK) {
      status =
          supine_basis_scale(frames->basis, weights, course->volume[t], &frames->scale[t], &cause);
    }
    if (status != SUPINE_OK) {
      return supine_error_set(error, status, "at %.3f s: %s", course->time[t], cause.message);
    }
    for (size_t lung = 0; lung < course->lungs; ++lung) {
      frames->volumes[t * course->lungs + lung] =
          supine_basis_lung_volume(frames->basis, lung, weights, frames->scale[t]);
    }
  }
  return SUPINE_OK;
}

/* Whether equal steps from frame `first` to `last` keep the volumes of those between. */
static bool run_holds(const breath_frames *frames, const double cubic[3], size_t first,
                      size_t last) {
  const double begin = frames->scale[first];
  const double step = (frames->scale[last] - begin) / (double)(last - first);
  for (size_t t = first + 1; t < last; ++t) {
    const double volume = supine_volume_at(cubic, begin + step * (double)(t - first));
    if (fabs(volume - frames->course->volume[t]) > tolerance) {
      return false;
    }
  }
  return true;
}

/* Runs, greedily; within one, scales and volumes become those of the equal steps. */
static void find_runs(breath_frames *frames) {
  const breath_course *course = frames->course;
  for (size_t t = 0; t < course->count; ++t) {
    frames->run[t] = t;
  }
  double weights[SUPINE_MODES_MAX];
  double cubic[3];
  if (!course->fixed ||
      supine_basis_weights(frames->basis, course->gravity, weights) != SUPINE_OK) {
    return;
  }
  supine_basis_cubic(frames->basis, weights, cubic);
  size_t first = 0;
  while (first < course->count) {
    size_t last = first;
    while (last + 1 < course->count && last - first < RUN_MAX &&
           run_holds(frames, cubic, first, last + 1)) {
      ++last;
    }
    if (last == first + 1) { /* a step would cost more than placing the frame */
      last = first;
    }
    const double begin = frames->scale[first];
    const double step = last > first ? (frames->scale[last] - begin) / (double)(last - first) : 0.0;
    for (size_t t = first + 1; t <= last; ++t) {
      frames->run[t] = first;
      frames->scale[t] = begin + step * (double)(t - first);
      for (size_t lung = 0; lung < course->lungs; ++lung) {
        frames->volumes[t * course->lungs + lung] =
            supine_basis_lung_volume(frames->basis, lung, weights, frames->scale[t]);
      }
      ++frames->stepped;
    }
    first = last + 1;
  }
}

supine_status supine_breath_frames_create(const supine_basis *basis, const breath_course *course,
                                          breath_frames **frames, supine_error *error) {
  const size_t count = course->count;
  breath_frames *made = calloc(1, sizeof *made);
  *frames = NULL;
  if (made == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu frames", count);
  }
  made->basis = basis;
  made->course = course;
  made->scale = calloc(count, sizeof *made->scale);
  made->volumes = calloc(count * course->lungs, sizeof *made->volumes);
  made->run = calloc(count, sizeof *made->run);
  made->step = malloc(3 * supine_basis_get_info(basis)->vertex_count * sizeof *made->step);
  if (made->scale == NULL || made->volumes == NULL || made->run == NULL || made->step == NULL) {
    supine_breath_frames_destroy(made);
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu frames", count);
  }
  const supine_status status = find_scales(made, error);
  if (status != SUPINE_OK) {
    supine_breath_frames_destroy(made);
    return status;
  }
  find_runs(made);
  *frames = made;
  return SUPINE_OK;
}

static void fill(double *scales, size_t lungs, double value) {
  for (size_t lung = 0; lung < lungs; ++lung) {
    scales[lung] = value;
  }
}

/* A frame from its orientation and volume: what a player that knew nothing in advance would do. */
static void place(breath_frames *frames, size_t t, float *xyz) {
  const breath_course *course = frames->course;
  double weights[SUPINE_MODES_MAX];
  double scales[SUPINE_LUNGS_MAX];
  double scale = frames->scale[t];
  (void)supine_basis_weights(frames->basis, course->gravity + 3 * t, weights);
  (void)supine_basis_scale(frames->basis, weights, course->volume[t], &scale, NULL);
  fill(scales, course->lungs, scale);
  supine_deform(frames->basis, weights, scales, xyz);
  if (t + 1 < course->count && frames->run[t + 1] == t) { /* a run begins */
    fill(scales, course->lungs, frames->scale[t + 1] - frames->scale[t]);
    supine_displace_range(frames->basis, weights, scales, 0,
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

const double *supine_breath_frames_volumes(const breath_frames *frames) {
  return frames->volumes;
}

size_t supine_breath_frames_stepped(const breath_frames *frames) {
  return frames->stepped;
}
