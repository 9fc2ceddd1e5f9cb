/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute the surfaces of a breath, frame after frame. */
#ifndef SUPINE_BREATH_FRAMES_H
#define SUPINE_BREATH_FRAMES_H

#include <stdbool.h>

#include <supine/breath.h>
#include <supine/runtime.h>

#include "program/breath/turn.h"

/* Where gravity turns, each frame is evaluated from its orientation and volume. Where it is
 * constant, frames form runs: the first frame of a run is evaluated, and each of the others is one
 * constant step on, three additions per vertex. A run lasts as long as every volume is within 0.01
 * mL of the requested one. */
typedef struct breath_frames {
  const supine_basis *basis;
  size_t count;    /* T */
  size_t lungs;    /* G */
  double *time;    /* [T] s */
  double *above;   /* [T] requested volume of all lungs together, mL above rest */
  double *gravity; /* [T, 3] */
  double *volumes; /* [T, G] gas and tissue, mL */
  bool fixed;      /* gravity is constant */
  size_t stepped;  /* number of frames computed by a step */
  /* [T, G, axis]; of the second frame of a run: one constant step after the first frame's */
  double (*gains)[SUPINE_LUNGS_MAX][3];
  size_t *run; /* [T] first frame of each frame's run */
  float *step; /* [N, 3] mm, of the present run */
  size_t next; /* number of the next frame */
} breath_frames;

/* Return the state of a breath at `ml` above rest in the posture, or above the scan where rest is
 * unknown. */
supine_state supine_breath_state(const supine_basis *basis, const double gravity[3], double ml);

/* Compute the volumes and gains of frames 0 to `count` - 1, `rate` per second, and find the runs.
 * @param basis   must outlive the frames
 * @param frames  starts zeroed; release with supine_breath_frames_free, also after a failure
 * @retval SUPINE_ERROR_NUMERICAL  a volume is out of reach; the message has the time of the frame
 * Else as supine_breath_evaluate. Eight parameters: the basis, the breath, the turn, the frames. */
supine_status supine_breath_frames_create(const supine_basis *basis, const supine_pv *pv,
                                          const supine_pv_breath *breath, const breath_turn *turn,
                                          double rate, size_t count, breath_frames *frames,
                                          supine_error *error);
void supine_breath_frames_free(breath_frames *frames);

/* Compute the positions [N, 3] of the next frame from those of the previous one in `xyz`; return
 * the time taken, s. */
double supine_breath_frames_next(breath_frames *frames, float *xyz);

#endif
