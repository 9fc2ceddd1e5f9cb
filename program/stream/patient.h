/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * The patient as last heard of: the newest pose, smoothed or not, the volume, and the moment of the
 * lungs that follows from them. */
#ifndef SUPINE_STREAM_PATIENT_H
#define SUPINE_STREAM_PATIENT_H

#include "program/stream/server.h"

typedef struct supine_stream_patient {
  const supine_basis *basis;
  const supine_stream_options *options;
  supine_stream_counts *counts;
  double begun;                      /* s of the clock */
  bool posed;                        /* at least one pose was received */
  bool fresh;                        /* the pose was not shown yet */
  double first;                      /* s of the clock, of the first pose: where a record begins */
  double received;                   /* s of the clock, of the newest */
  uint64_t stamp;                    /* the newest's; 0: none */
  double gravity[3];                 /* the newest's */
  double smooth[3];                  /* as shown */
  double smoothed;                   /* when `smooth` was computed, s of the clock */
  bool turning;                      /* `smooth` has not reached the pose yet */
  double warned;                     /* s of the clock, of the last warning */
  uint64_t unsaid;                   /* warnings since then */
  double gains[SUPINE_LUNGS_MAX][3]; /* gains of the last volume that could be reached */
} supine_stream_patient;

/* Supine until a pose comes. */
supine_stream_patient supine_stream_patient_begin(const supine_basis *basis,
                                                  const supine_stream_options *options,
                                                  supine_stream_counts *counts, double now);

/* A warning, at most one a second; the others are counted. */
void supine_stream_patient_warn(supine_stream_patient *patient, double now, const char *format, ...)
    SUPINE_PRINTF(3, 4);

/* Store a pose or volume; ignore other messages. */
void supine_stream_patient_hear(supine_stream_patient *patient,
                                const supine_stream_message *message, double received,
                                uint64_t stamp);

/* Takes a direction of gravity in body axes, any length but 0: a pose from a file or a phone. */
void supine_stream_patient_pose(supine_stream_patient *patient, const double gravity[3],
                                double received);

/* Return whether the lungs move without new poses. */
bool supine_stream_patient_moves(const supine_stream_patient *patient);

/* Compute the lungs at `now`; marks the pose as shown. */
void supine_stream_patient_moment(supine_stream_patient *patient, double now,
                                  supine_stream_moment *moment);

#endif
