/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute the direction of gravity while the body turns, and make a state of a given volume. */
#ifndef SUPINE_BREATH_TURN_H
#define SUPINE_BREATH_TURN_H

#include <supine/breath.h>
#include <supine/runtime.h>

/* A turn from one posture to another at constant speed. */
typedef struct breath_turn {
  double from[3], to[3]; /* unit vectors along gravity, in body axes */
  double seconds;        /* duration of the turn, s; after it, gravity stays at `to` */
} breath_turn;

/* Compute the direction of gravity at a time, s, on the shorter arc from turn->from to turn->to.
 * Between opposite directions, the body turns over its left side; but if gravity begins within 60
 * degrees of the long axis of the body, or exactly along x, the body turns over its back. */
void supine_options_turn_gravity(const breath_turn *turn, double time, double gravity[3]);

/* Read a text such as "supine:left:10s" into the breath_turn `turn`. */
supine_status supine_options_turn_read(const char *text, void *turn, supine_error *error);

/* Return the state whose volume is `ml` mL above the resting volume or, if the resting volume is
 * unknown, above the scan's volume. */
supine_state supine_options_breath_state(const supine_basis *basis, const double gravity[3],
                                         double ml);

#endif
