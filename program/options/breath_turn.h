/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute gravity during a turn of the body, and the state of a breath. */
#ifndef SUPINE_BREATH_TURN_H
#define SUPINE_BREATH_TURN_H

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

/* Return the state of a breath at `ml` above rest in the posture, or above the scan where rest is
 * unknown. */
supine_state supine_breath_state(const supine_basis *basis, const double gravity[3], double ml);

#endif
