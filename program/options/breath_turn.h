/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute the states of a breath, in one posture or while the body turns. */
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

/* Return the number of frames of a film of some seconds, with one at each end. */
double supine_options_frame_count(double seconds, double fps);

/* Read a text such as "supine:left:10s" into the breath_turn `turn`. */
supine_status supine_options_turn_read(const char *text, void *turn, supine_error *error);

/* Return the state whose volume is `ml` mL above the resting volume or, if the resting volume is
 * unknown, above the scan's volume. */
supine_state supine_options_breath_state(const supine_basis *basis, const double gravity[3],
                                         double ml);

/* A breath that is computed frame by frame, from its start at rest on. */
typedef struct supine_options_breath {
  breath_turn turn; /* both directions are equal if the body does not turn */
  supine_pv_breath cycle;
  const char *pv; /* file of the pressure-volume relation; NULL for a normal adult's */
  double fps;
  size_t count; /* number of frames */
} supine_options_breath;

/* Fill in the direction of gravity of a breath in one posture. Refuse a state that names a volume,
 * as a breath starts at rest. */
supine_status supine_options_breath_lie(const supine_state *posture, supine_options_breath *breath,
                                        supine_error *error);

/* List the states of all frames, and refuse a breath that the lungs cannot hold. Warn of what is
 * wrong with the lungs of smallest and of largest volume (supine_options_pose).
 * @param command  name of the command that warns
 * @param time     [breath->count] time of each frame since the start, s; output
 * @param state    [breath->count] output */
supine_status supine_options_breath_list(const supine_basis *basis, const char *command,
                                         const supine_options_breath *breath, double *time,
                                         supine_state *state, supine_error *error);

#endif
