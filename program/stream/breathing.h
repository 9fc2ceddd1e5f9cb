/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Compute the volume of the lungs at a time: a fixed one, or rest in the posture plus a breath. */
#ifndef SUPINE_STREAM_VOLUME_H
#define SUPINE_STREAM_VOLUME_H

#include <stdbool.h>

#include "program/breath/breath_frames.h"

typedef struct supine_stream_volume {
  bool breathes;      /**< else the volume of `fixed` */
  supine_state fixed; /**< its gravity is ignored */
  supine_pv pv;
  supine_pv_breath breath;
} supine_stream_volume;

/** Set the volume to that of a breath, which starts at time 0. Statuses as supine_breath_evaluate.
 */
supine_status supine_stream_volume_breathe(supine_stream_volume *volume, const supine_pv *pv,
                                           const supine_pv_breath *breath, supine_error *error);

/** Set a fixed volume, in the form of supine_state_parse_volume: rest+500, full-300, 2600mL.
 * @retval SUPINE_ERROR_ARGUMENT  none of these; `volume` is unchanged */
supine_status supine_stream_volume_fix(supine_stream_volume *volume, const char *text,
                                       supine_error *error);

/** Return the state at `time` s in the posture of `gravity` (unit). */
supine_state supine_stream_volume_at(const supine_stream_volume *volume, const supine_basis *basis,
                                     const double gravity[3], double time);

#endif
