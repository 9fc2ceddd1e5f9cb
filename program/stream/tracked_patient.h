/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Store the newest pose, volume and observed points, and compute the state of the lungs. */
#ifndef SUPINE_STREAM_PATIENT_H
#define SUPINE_STREAM_PATIENT_H

#include "program/options/breath_turn.h"
#include "program/stream/server.h"

/** Volume of the lungs, either fixed or given by a breath. */
struct supine_stream_volume {
  bool breathes;      /**< true if the volume follows `breath`, false if it is `fixed` */
  supine_state fixed; /**< fixed volume; the field `gravity` is not used */
  supine_pv pv;
  supine_pv_breath breath;
};

/** Let the volume follow a breath from time 0. Return the status of supine_breath_evaluate. */
supine_status supine_stream_volume_breathe(supine_stream_volume *volume, const supine_pv *pv,
                                           const supine_pv_breath *breath, supine_error *error);

/** Check that the lungs can hold a fixed volume or, at both ends, a breath.
 * @param gravity   [3] direction of gravity
 * @param findings  told of a volume that they cannot hold, if the basis allows it; or NULL
 * @return the status of supine_basis_pose; SUPINE_ERROR_UNSUPPORTED for the scan of a lung that has
 *         collapsed since */
supine_status supine_stream_volume_judge(const supine_stream_volume *volume,
                                         const supine_basis *basis, const double gravity[3],
                                         supine_findings *findings, supine_error *error);

/** Return the state for the unit vector `gravity`, `time` seconds after the breath begins. */
supine_state supine_stream_volume_at(const supine_stream_volume *volume, const supine_basis *basis,
                                     const double gravity[3], double time);

/** Newest input, and what the next frame needs. Times are in seconds by supine_clock_seconds. */
typedef struct supine_stream_patient {
  const supine_basis *basis;
  const supine_stream_options *options;
  supine_stream_counts *counts;
  double breath_begun;
  double pose_received; /* time of receipt of the newest pose or observed point, s; -1 if none */
  double received;      /* time of receipt of the newest message, s; -1 if none */
  bool pending;         /* true until a frame shows the newest message */
  uint64_t stamp;       /* time stamp of the newest pose or point, 2^-32 s since 1970; 0 if none */
  double gravity[3];    /* direction of gravity in the newest pose */
  double warned_at;
} supine_stream_patient;

/* Return a patient who lies supine until a pose is received. */
supine_stream_patient supine_stream_patient_begin(const supine_basis *basis,
                                                  const supine_stream_options *options,
                                                  supine_stream_counts *counts, double now);

/* Pass a warning to the options' `warn`, unless there was one within the last second. */
void supine_stream_patient_warn(supine_stream_patient *patient, double now, const char *format, ...)
    SUPINE_PRINTF(3, 4);

/* Store the pose, the volume or the observed points of a message; ignore other messages. Refuse a
 * message whole: the posture and the volume of before then stay together.
 * @retval SUPINE_ERROR_ARGUMENT   the message has no pose or no volume
 * @retval SUPINE_ERROR_NUMERICAL  the lungs cannot hold the volume in the posture */
supine_status supine_stream_patient_receive(supine_stream_patient *patient,
                                            const supine_stream_message *message, double received,
                                            uint64_t stamp, supine_error *error);

/* Store a pose from a file or a phone: the direction of gravity in body axes, of any length. A
 * vector that is zero or not finite is refused. Statuses: as supine_stream_patient_receive. */
supine_status supine_stream_patient_pose(supine_stream_patient *patient, const double gravity[3],
                                         double received, supine_error *error);

/* Compute the state of the lungs at `now`, and mark the newest message as shown. */
void supine_stream_patient_snapshot(supine_stream_patient *patient, double now,
                                    supine_stream_snapshot *snapshot);

#endif
