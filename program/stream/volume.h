/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * How full the lungs are at a moment: the posture's rest plus a breath, or a volume that was given.
 *
 *     V(t) = rest(gravity) + breath(t)        mL relative to the basis' reference */
#ifndef SUPINE_STREAM_VOLUME_H
#define SUPINE_STREAM_VOLUME_H

#include <stdbool.h>

#include "program/breath/pv.h"
#include <supine/runtime.h>

enum { SUPINE_STREAM_BREATH_SAMPLES = 1024 }; /* of one breath; straight lines between */

typedef struct supine_stream_volume {
  bool breathes; /**< else `fixed` */
  bool absolute; /**< `fixed` counts from the reference, not from the posture's rest */
  double fixed;  /**< mL */
  double period; /**< s of a breath */
  double breath[SUPINE_STREAM_BREATH_SAMPLES + 1]; /**< mL above rest, over a period */
} supine_stream_volume;

/** Breathing.
 * Statuses as supine_breath_evaluate. */
supine_status supine_stream_volume_breathe(supine_stream_volume *volume, const supine_pv *pv,
                                           const supine_pv_breath *breath, supine_error *error);

/** A volume as people write it: rest, full, rest+500, rest-200, or mL from the reference: -1200.
 * @retval SUPINE_ERROR_ARGUMENT  none of these; `volume` is as before */
supine_status supine_stream_volume_fix(supine_stream_volume *volume, const char *text,
                                       supine_error *error);

/** mL relative to the reference, at `time` s, in the posture of `gravity` (unit). */
double supine_stream_volume_at(const supine_stream_volume *volume, const supine_basis *basis,
                               const double gravity[3], double time);

#endif
