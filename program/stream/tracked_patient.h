/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Store the newest pose, volume and observed points, and compute the state of the lungs from them.
 */
#ifndef SUPINE_STREAM_PATIENT_H
#define SUPINE_STREAM_PATIENT_H

#include "program/options/breath_turn.h"
#include "program/stream/server.h"

/** How the volume is determined. */
struct supine_stream_volume {
  bool breathes;      /**< true: `pv` and `breath` give the volume; false: `fixed` does */
  supine_state fixed; /**< fixed volume; its gravity is not used */
  supine_pv pv;
  supine_pv_breath breath;
};

/** Let the volume follow a breath that begins at time 0. Statuses as supine_breath_evaluate. */
supine_status supine_stream_volume_breathe(supine_stream_volume *volume, const supine_pv *pv,
                                           const supine_pv_breath *breath, supine_error *error);

/** Set a fixed volume from a text such as rest+500, full-300 or 2600mL.
 * @retval SUPINE_ERROR_ARGUMENT  the text is not a volume; `volume` is unchanged */
supine_status supine_stream_volume_fix(supine_stream_volume *volume, const char *text,
                                       supine_error *error);

/** Return the state at `time`, s, for a direction of gravity (unit vector). */
supine_state supine_stream_volume_at(const supine_stream_volume *volume, const supine_basis *basis,
                                     const double gravity[3], double time);

typedef struct supine_stream_patient {
  const supine_basis *basis;
  const supine_stream_options *options;
  supine_stream_counts *counts;
  /* Times are in seconds of supine_clock_seconds. */
  double begun;         /* when the breath began */
  double first_pose;    /* when the first pose was received: time 0 of a recording */
  double pose_received; /* when the newest pose or point was received; < 0: none yet */
  double received;      /* when the newest message was received */
  bool pending;         /* no frame shows the newest message yet */
  uint64_t stamp;       /* time stamp of the newest pose or point, from its header; 0: none */
  double gravity[3];    /* direction of gravity in the newest pose */
  double smooth[3];     /* smoothed direction of gravity, which frames show */
  double smoothed;      /* when `smooth` was computed */
  bool turning;         /* `smooth` has not reached `gravity` yet */
  double warned;        /* when the last warning was given */
  double gains[SUPINE_LUNGS_MAX][3]; /* gains of the last volume that could be reached */
} supine_stream_patient;

/* Return a patient who lies supine until a pose is received. */
supine_stream_patient supine_stream_patient_begin(const supine_basis *basis,
                                                  const supine_stream_options *options,
                                                  supine_stream_counts *counts, double now);

/* Pass a warning to the options' `warn`, unless there was one within the last second. */
void supine_stream_patient_warn(supine_stream_patient *patient, double now, const char *format, ...)
    SUPINE_PRINTF(3, 4);

/* Store the pose, the volume or the observed points of a message; ignore other messages. */
void supine_stream_patient_receive(supine_stream_patient *patient,
                                   const supine_stream_message *message, double received,
                                   uint64_t stamp);

/* Store a pose from a file or a phone: the direction of gravity in body axes, of any length. A
 * vector that is zero or not finite is refused. */
void supine_stream_patient_pose(supine_stream_patient *patient, const double gravity[3],
                                double received);

/* Return whether the lungs move without new messages. */
bool supine_stream_patient_moves(const supine_stream_patient *patient);

/* Compute the state of the lungs at `now`, and mark the newest message as shown. */
void supine_stream_patient_snapshot(supine_stream_patient *patient, double now,
                                    supine_stream_snapshot *snapshot);

#endif
