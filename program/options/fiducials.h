/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Register a state at points of the scan, and find the errors that are left after it. */
#ifndef SUPINE_OPTIONS_FIDUCIALS_H
#define SUPINE_OPTIONS_FIDUCIALS_H

#include "program/options/inside.h"

/* Option table that holds only --frame with a file of points, which sets a supine_frame. */
extern const struct supine_option supine_options_fiducials_frame[];

/* The value of --frame. */
typedef struct supine_frame {
  bool hilum;         /* whether the displacement of the hilum is subtracted */
  const char *points; /* file of points that stay in place; NULL otherwise */
} supine_frame;

/* A rigid motion: x becomes rotation x + translation, mm. */
typedef struct supine_motion {
  double rotation[9], translation[3];
} supine_motion;

/* Find the motion that moves the predicted positions of points to their places in the scan best,
 * for two states. Replace the expected errors by those that remain. Fail if a point is no vertex of
 * the basis, or if fewer than three points, or points too near to one line, leave the motion open.
 * @param path    file of points in the scan (mesh/io/points.h)
 * @param states  [2] the state, and that from which displacements count
 * @param motion  [2] written; the identity for the scan */
supine_status supine_options_fiducials(const char *path, const supine_basis *basis,
                                       const supine_state *states[2], supine_errors *errors,
                                       supine_motion motion[2], supine_error *error);

/* Move a target, and the place from which its displacement counts. */
void supine_options_fiducials_target(const supine_motion motion[2], supine_target *target);

/* Apply a motion to a position. */
void supine_options_fiducials_move(const supine_motion *motion, double at[3]);

#endif
