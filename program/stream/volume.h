/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * How full the lungs are at a moment: a volume that was given, or the posture's rest plus a breath.
 */
#ifndef SUPINE_STREAM_VOLUME_H
#define SUPINE_STREAM_VOLUME_H

#include <stdbool.h>

#include "program/breath/breath_frames.h"

enum { SUPINE_STREAM_BREATH_SAMPLES = 1024 }; /* samples per breath, interpolated linearly */

typedef struct supine_stream_volume {
  bool breathes;                                   /**< else `fixed` */
  supine_state fixed;                              /**< its volume */
  double period;                                   /**< s of a breath */
  double breath[SUPINE_STREAM_BREATH_SAMPLES + 1]; /**< mL above rest, over a period */
} supine_stream_volume;

/** Breathe.
 * Statuses as supine_breath_evaluate. */
supine_status supine_stream_volume_breathe(supine_stream_volume *volume, const supine_pv *pv,
                                           const supine_pv_breath *breath, supine_error *error);

/** Keep a volume as supine_state_parse_volume reads it: rest, rest+500, full-300, 2600mL.
 * @retval SUPINE_ERROR_ARGUMENT  none of these; `volume` is as before */
supine_status supine_stream_volume_fix(supine_stream_volume *volume, const char *text,
                                       supine_error *error);

/** The state at `time` s, in the posture of `gravity` (unit). */
supine_state supine_stream_volume_at(const supine_stream_volume *volume, const supine_basis *basis,
                                     const double gravity[3], double time);

#endif
