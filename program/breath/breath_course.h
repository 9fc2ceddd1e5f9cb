/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The times, volumes and directions of gravity of a breath, frame by frame. */
#ifndef SUPINE_BREATH_COURSE_H
#define SUPINE_BREATH_COURSE_H

#include "program/breath/pv.h"
#include <supine/runtime.h>

/* A turn from one posture to another at constant speed, after which gravity stays. */
typedef struct breath_turn {
  double from[3], to[3]; /* unit */
  double seconds;        /* 0: gravity is `to` throughout */
} breath_turn;

/* Compute gravity at a time, on the shorter arc. Between opposite directions the arc passes the
 * left side, or the back where gravity starts along the body or to a side. */
void supine_breath_turn_gravity(const breath_turn *turn, double time, double gravity[3]);

typedef struct breath_course {
  size_t count;    /* T */
  size_t lungs;    /* G */
  bool fixed;      /* gravity is constant */
  double *time;    /* [T] s */
  double *volume;  /* [T] of all lungs together, mL above rest */
  double *gravity; /* [T, 3] */
} breath_course;

/* Compute frames 0 to `count` - 1 at `rate` a second; release with supine_breath_course_free. */
supine_status supine_breath_course_create(const supine_pv *pv, const supine_pv_breath *breath,
                                          const breath_turn *turn, double rate, size_t count,
                                          size_t lungs, breath_course *course, supine_error *error);
void supine_breath_course_free(breath_course *course);

#endif
