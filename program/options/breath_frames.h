/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute the states of a breath, frame after frame, and of a turn of the body. */
#ifndef SUPINE_BREATH_FRAMES_H
#define SUPINE_BREATH_FRAMES_H

#include <supine/breath.h>
#include <supine/runtime.h>

/* A turn from one posture to another at constant speed, after which gravity stays. */
typedef struct breath_turn {
  double from[3], to[3]; /* unit */
  double seconds;        /* 0: gravity is `to` throughout */
} breath_turn;

/* Compute gravity at a time, on the shorter arc. Between opposite directions the arc passes the
 * left side, or the back where gravity starts along the body or to a side. */
void supine_breath_turn_gravity(const breath_turn *turn, double time, double gravity[3]);

/* Read "supine:left:10s" into a breath_turn, as a supine_option_reader. */
supine_status supine_breath_turn_read(const char *text, void *turn, supine_error *error);

/* Times, directions of gravity and volumes of all frames. */
typedef struct breath_frames {
  const supine_basis *basis;
  size_t count;    /* T */
  size_t lungs;    /* G */
  double *time;    /* [T] s */
  double *above;   /* [T] requested volume of all lungs together, mL above rest or the scan */
  double *gravity; /* [T, 3] */
  double *volumes; /* [T, G] gas and tissue, mL */
} breath_frames;

/* Return the state of a breath at `ml` above rest in the posture, or above the scan where rest is
 * unknown. */
supine_state supine_breath_state(const supine_basis *basis, const double gravity[3], double ml);

/* Compute the volumes of frames 0 to `count` - 1, `rate` per second.
 * @param basis   must outlive the frames
 * @param frames  starts zeroed; release with supine_breath_frames_free, also after a failure
 * @retval SUPINE_ERROR_NUMERICAL  a volume is out of reach; the message states the frame's time
 * Else as supine_breath_evaluate. Eight parameters: the basis, the breath, the turn, the frames. */
supine_status supine_breath_frames_create(const supine_basis *basis, const supine_pv *pv,
                                          const supine_pv_breath *breath, const breath_turn *turn,
                                          double rate, size_t count, breath_frames *frames,
                                          supine_error *error);
void supine_breath_frames_free(breath_frames *frames);

/* Compute the pose of frame t. Statuses as supine_basis_pose. */
supine_status supine_breath_frames_pose(const breath_frames *frames, size_t t, supine_pose *pose,
                                        supine_error *error);

#endif
