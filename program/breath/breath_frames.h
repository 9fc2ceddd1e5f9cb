/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute the surfaces of a breath, frame after frame. */
#ifndef SUPINE_BREATH_FRAMES_H
#define SUPINE_BREATH_FRAMES_H

#include "program/breath/breath_course.h"

/* Where gravity turns, each frame is evaluated from its orientation and volume. Where it is
 * constant, frames form runs: the first frame of a run is evaluated, and each of the others is one
 * constant step on, three additions per vertex. A run lasts as long as every volume is within 0.01
 * mL of the requested one. */
typedef struct breath_frames breath_frames;

/* Return the state of a breath at `ml` above rest in the posture, or above the scan where rest is
 * unknown. */
supine_state supine_breath_state(const supine_basis *basis, const double gravity[3], double ml);

/* Find the gains of all frames, and the runs. The arguments must outlive the frames.
 * @retval SUPINE_ERROR_NUMERICAL  a volume is out of reach; the message has the time of the frame
 */
supine_status supine_breath_frames_create(const supine_basis *basis, const breath_course *course,
                                          breath_frames **frames, supine_error *error);
void supine_breath_frames_destroy(breath_frames *frames);

/* Compute the positions [N, 3] of the next frame from those of the previous one in `xyz`; return
 * the time taken, s. */
double supine_breath_frames_next(breath_frames *frames, float *xyz);

/* Return the volumes of the lungs, gas and tissue, [T, G], mL. */
const double *supine_breath_frames_volumes(const breath_frames *frames);

/* Return the number of frames computed as a step. */
size_t supine_breath_frames_stepped(const breath_frames *frames);

#endif
