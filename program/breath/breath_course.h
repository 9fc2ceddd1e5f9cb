/* SPDX-License-Identifier: GPL-3.0-or-later */
/* A breath as a series of frames: when, how much air, and where gravity points. */
#ifndef SUPINE_BREATH_COURSE_H
#define SUPINE_BREATH_COURSE_H

#include "program/breath/pv.h"
#include <supine/runtime.h>

/* From one posture to another at constant speed, then staying there. */
typedef struct breath_turn {
  double from[3], to[3]; /* unit */
  double seconds;        /* 0: gravity is `to` throughout */
} breath_turn;

/* Compute gravity at a time: along the shorter arc; between opposite directions over the left side,
 * or over the back where gravity starts along the body. */
void supine_breath_turn_gravity(const breath_turn *turn, double time, double gravity[3]);

/* Compute all frames for `lungs` lungs. */
typedef struct breath_course {
  size_t count;    /* T */
  size_t lungs;    /* G */
  bool fixed;      /* gravity does not turn */
  double *time;    /* [T] s */
  double *volume;  /* [T] mL above rest, of all lungs together */
  double *gravity; /* [T, 3] */
} breath_course;

/* Compute frames 0 to `count` - 1 at `rate` a second; release with supine_breath_course_free. */
supine_status supine_breath_course_create(const supine_pv *pv, const supine_pv_breath *breath,
                                          const breath_turn *turn, double rate, size_t count,
                                          size_t lungs, breath_course *course, supine_error *error);
void supine_breath_course_free(breath_course *course);

#endif
