/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute the direction of gravity during a turn of the body. */
#ifndef SUPINE_TURN_H
#define SUPINE_TURN_H

/* A turn from one posture to another at constant speed, after which gravity stays. */
typedef struct breath_turn {
  double from[3], to[3]; /* unit */
  double seconds;        /* 0: gravity is `to` throughout */
} breath_turn;

/* Compute gravity at a time, on the shorter arc. Between opposite directions the arc passes the
 * left side, or the back where gravity starts along the body or to a side. */
void supine_breath_turn_gravity(const breath_turn *turn, double time, double gravity[3]);

#endif
