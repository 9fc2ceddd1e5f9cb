/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Append animations of breathing: one while the patient turns about the long axis, and one in each
 * lying posture. Gravity always points down. */
#include <math.h>
#include <stdlib.h>

#include "program/view/export/glb.h"
#include "program/view/export/moments.h"

static const double pi = 3.14159265358979323846;

/* At a roll of t radians, gravity in the patient's axes (LPS) is (sin t, cos t, 0). In glTF's axes
 * the patient turns by t about y, the body's long axis, then by -90 degrees about x to lie down. */
void supine_export_glb_rotation(double roll, float q[4]) {
  const double c = cos(roll / 2) * sqrt(0.5);
  const double s = sin(roll / 2) * sqrt(0.5);
  q[0] = (float)-c;
  q[1] = (float)s;
  q[2] = (float)-s;
  q[3] = (float)c;
}

/* Compute one frame: the weights of all morph targets, `seconds` after the start of a breath.
 * `rows` points to this frame of lung 0 in an array [lungs, frames, targets]. */
static void make_frame(glb *g, double roll, double seconds, float *rows, size_t frames) {
  double weights[EXPORT_TARGETS_MAX];
  for (size_t i = 0; i < g->info->lung_count; ++i) {
    supine_export_moment(&g->targets, roll, seconds, i, weights);
    for (size_t j = 0; j < g->targets.count; ++j) {
      rows[i * frames * g->targets.count + j] = (float)weights[j];
    }
  }
}

/* Append an animation of breathing at `roll` radians, or during one full turn if `roll` is NAN. */
static void add(glb *g, json_t *animations, const char *name, double roll, size_t seconds) {
  const size_t count = g->info->lung_count;
  const size_t frames = EXPORT_RATE * seconds + 1;
  const size_t targets = g->targets.count;
  SUPINE_ARENA arena = {0};
  float *times = supine_arena_take(&arena, frames, sizeof *times);
  float *rotations = supine_arena_take(&arena, frames, 4 * sizeof *rotations);
  float *weights = supine_arena_take(&arena, count * frames * targets, sizeof *weights);
  if (arena.failed) {
    g->status = SUPINE_ERROR_MEMORY;
    return;
  }
  for (size_t i = 0; i < frames; ++i) {
    const double at = (double)i / EXPORT_RATE;
    const double turned = isnan(roll) ? supine_export_roll(at) : roll;
    times[i] = (float)at;
    supine_export_glb_rotation(turned, rotations + 4 * i);
    make_frame(g, turned, at, weights + i * targets, frames);
  }
  const json_int_t input = supine_export_glb_put(g, GLB_TIMES, times, NULL, frames);
  json_t *samplers = json_pack("[{s:I, s:I}]", "input", input, "output",
                               supine_export_glb_put(g, GLB_ROTATIONS, rotations, NULL, frames));
  json_t *channels =
      json_pack("[{s:i, s:{s:i, s:s}}]", "sampler", 0, "target", "node", 0, "path", "rotation");
  for (size_t i = 0; i < count; ++i) {
    (void)json_array_append_new(
        samplers, json_pack("{s:I, s:I}", "input", input, "output",
                            supine_export_glb_put(g, GLB_WEIGHTS, weights + i * frames * targets,
                                                  NULL, frames * targets)));
    (void)json_array_append_new(channels,
                                json_pack("{s:I, s:{s:I, s:s}}", "sampler", (json_int_t)i + 1,
                                          "target", "node", (json_int_t)i + 1, "path", "weights"));
  }
  (void)json_array_append_new(animations, json_pack("{s:s, s:o, s:o}", "name", name, "samplers",
                                                    samplers, "channels", channels));
}

void supine_export_glb_animate(glb *g) {
  static const char *const names[EXPORT_POSTURES] = {"supine", "left side", "prone", "right side"};
  json_t *animations = json_array();
  add(g, animations, "turning", NAN, EXPORT_SECONDS * EXPORT_POSTURES);
  for (size_t p = 0; p < EXPORT_POSTURES; ++p) {
    add(g, animations, names[p], (double)p * pi / 2, EXPORT_BREATH_SECONDS);
  }
  (void)json_object_set_new(g->root, "animations", animations);
}
