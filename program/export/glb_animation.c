/* SPDX-License-Identifier: GPL-3.0-or-later */
/* An animation that breathes and turns the patient about the long axis, gravity staying down. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <supine/sh.h>

#include "program/export/glb.h"

static const double pi = 3.14159265358979323846;
enum { RATE = 20, POSTURES = 4, SECONDS = 6, BREATH_SECONDS = 3 };

/* Turn about the long axis at a time: each posture for half of its time, then on to the next. */
static double roll_at(double seconds) {
  const double stage = floor(seconds / SECONDS);
  const double x = fmax(0, 2 * (seconds / SECONDS - stage) - 1);
  return pi / 2 * (stage + x * x * (3 - 2 * x));
}

/* Gravity in the body is (sin t, cos t, 0): supine, left, prone, right. In glTF's axes the patient
 * lies down, -90 degrees about x, after turning about y, the body's long axis, by t. */
static void rotation_at(double roll, float q[4]) {
  const double c = cos(roll / 2) * sqrt(0.5);
  const double s = sin(roll / 2) * sqrt(0.5);
  q[0] = (float)-c;
  q[1] = (float)s;
  q[2] = (float)-s;
  q[3] = (float)c;
}

static supine_status make_frame(const export_source *source, const export_glb_options *options,
                                const export_targets *targets, double seconds, float *row,
                                supine_error *error) {
  export_pose pose;
  const double roll = roll_at(seconds);
  const double g[3] = {sin(roll), cos(roll), 0};
  const double fraction = 0.5 - 0.5 * cos(2 * pi * seconds / BREATH_SECONDS);
  const supine_status status =
      supine_export_targets_at(source, &options->breath, targets, g, fraction, &pose, error);
  for (size_t j = 0; j < targets->count; ++j) {
    row[j] = (float)pose.weights[j];
  }
  return status;
}

supine_status supine_export_glb_animation_make(const export_source *source,
                                               const export_glb_options *options,
                                               const export_targets *targets,
                                               glb_animation *animation, supine_error *error) {
  const size_t frames = RATE * SECONDS * POSTURES + 1;
  glb_animation made = {.frames = frames,
                        .times = malloc(frames * sizeof(float)),
                        .weights = malloc(frames * targets->count * sizeof(float)),
                        .rotations = malloc(4 * frames * sizeof(float))};
  supine_status status = SUPINE_OK;
  if (made.times == NULL || made.weights == NULL || made.rotations == NULL) {
    supine_export_glb_animation_free(&made);
    *animation = made;
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "out of memory");
  }
  for (size_t i = 0; status == SUPINE_OK && i < frames; ++i) {
    const double seconds = (double)i / RATE;
    made.times[i] = (float)seconds;
    rotation_at(roll_at(seconds), made.rotations + 4 * i);
    status =
        make_frame(source, options, targets, seconds, made.weights + i * targets->count, error);
  }
  if (status != SUPINE_OK) {
    supine_export_glb_animation_free(&made);
  }
  *animation = made;
  return status;
}

void supine_export_glb_animation_free(glb_animation *animation) {
  free(animation->times);
  free(animation->weights);
  free(animation->rotations);
  *animation = (glb_animation){0};
}

json_t *supine_export_glb_animation_plan(const glb_animation *animation, size_t targets,
                                         size_t nodes, glb_plan *plan) {
  const double first = 0;
  const double last = (double)animation->times[animation->frames - 1];
  const size_t frames = animation->frames;
  const json_int_t times = (json_int_t)supine_export_glb_plan_add(
      plan, GLTF_FLOAT, "SCALAR", frames, GLTF_NO_TARGET, 1, &first, &last);
  const json_int_t weights = (json_int_t)supine_export_glb_plan_add(
      plan, GLTF_FLOAT, "SCALAR", frames * targets, GLTF_NO_TARGET, 1, NULL, NULL);
  const json_int_t turns = (json_int_t)supine_export_glb_plan_add(plan, GLTF_FLOAT, "VEC4", frames,
                                                                  GLTF_NO_TARGET, 4, NULL, NULL);
  json_t *list =
      json_pack("[{s:s, s:[{s:I, s:I, s:s}, {s:I, s:I, s:s}], s:[{s:i, s:{s:i, s:s}}, {s:i, "
                "s:{s:i, s:s}}]}]",
                "name", "breathe and turn", "samplers", "input", times, "output", weights,
                "interpolation", "LINEAR", "input", times, "output", turns, "interpolation",
                "LINEAR", "channels", "sampler", 0, "target", "node", 1, "path", "weights",
                "sampler", 1, "target", "node", 0, "path", "rotation");
  for (int node = 2; node <= (int)nodes; ++node) {
    (void)json_array_append_new(
        json_object_get(json_array_get(list, 0), "channels"),
        json_pack("{s:i, s:{s:i, s:s}}", "sampler", 0, "target", "node", node, "path", "weights"));
  }
  return list;
}
