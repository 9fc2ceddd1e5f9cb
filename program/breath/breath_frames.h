/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The surfaces of a breath, frame after frame, as a player in real time would compute them. */
#ifndef SUPINE_BREATH_FRAMES_H
#define SUPINE_BREATH_FRAMES_H

#include "program/breath/breath_course.h"

/* Where gravity turns, each frame is evaluated from its orientation and volume. Where it does not,
 * frames come in runs: the first of a run is placed, and each of the others is one step on, three
 * additions a vertex. A run goes on while steps of one
 * length keep every volume within 0.01 mL of what was asked. */
typedef struct breath_frames breath_frames;

/* The state of a breath of `ml` above the posture's rest; above the scan where no rest is known. */
supine_state supine_breath_state(const supine_basis *basis, const double gravity[3], double ml);

/* Finds every frame's gains and the runs. The arguments must outlive the frames.
 * SUPINE_ERROR_NUMERICAL: a volume that is out of reach, with the frame's time. */
supine_status supine_breath_frames_create(const supine_basis *basis, const breath_course *course,
                                          breath_frames **frames, supine_error *error);
void supine_breath_frames_destroy(breath_frames *frames);

/* The next frame's positions into xyz [N, 3], which holds the frame before's: call once a frame, in
 * order. Returns the seconds that it took. */
double supine_breath_frames_next(breath_frames *frames, float *xyz);

/* Volume of each lung, gas and tissue, [T, G], mL. */
const double *supine_breath_frames_volumes(const breath_frames *frames);

/* Return the number of frames computed as a step (three additions a vertex). */
size_t supine_breath_frames_stepped(const breath_frames *frames);

#endif
