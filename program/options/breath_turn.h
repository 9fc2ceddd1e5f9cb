/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute gravity while the body turns, and the state of the lungs at a volume of a breath. */
#ifndef SUPINE_BREATH_TURN_H
#define SUPINE_BREATH_TURN_H

#include <supine/breath.h>
#include <supine/runtime.h>

/* A turn from one posture to another at constant speed. */
typedef struct breath_turn {
  double from[3], to[3]; /* unit vectors along gravity in body axes */
  double seconds;        /* duration, after which gravity stays `to` */
} breath_turn;

/* Compute gravity at a time, s, on the shorter arc. Between opposite directions the arc passes the
 * left side, or the back if gravity begins near the long axis or on a side. */
void supine_breath_turn_gravity(const breath_turn *turn, double time, double gravity[3]);

/* Read a text such as "supine:left:10s" into the breath_turn `turn`. */
supine_status supine_breath_turn_read(const char *text, void *turn, supine_error *error);

/* Return the state of which the volume is `ml` mL above rest in the posture, or above the scan if
 * rest is unknown. */
supine_state supine_breath_state(const supine_basis *basis, const double gravity[3], double ml);

#endif
