/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Compute moments of the animations of a model: breaths, while the patient lies or turns. */
#ifndef SUPINE_EXPORT_MOMENTS_H
#define SUPINE_EXPORT_MOMENTS_H

#include "program/view/export/targets.h"

enum {
  EXPORT_RATE = 6, /**< frames per second */
  EXPORT_POSTURES = 4,
  EXPORT_SECONDS = 6,       /**< time in each posture and on the way to the next */
  EXPORT_BREATH_SECONDS = 3 /**< time of a breath */
};

/** Return the patient's roll, radians, `seconds` after the start of a full turn. Each posture takes
 * EXPORT_SECONDS: the patient lies still for the first half of this time, then turns to the next.
 */
double supine_export_roll(double seconds);

/** Compute the weights [targets->count] of a lung's morph targets, `seconds` after the start of a
 * breath, of a patient who is turned by `roll` radians about the body's long axis: 0 is supine, pi
 * / 2 the left side. */
void supine_export_moment(const export_targets *targets, double roll, double seconds, size_t lung,
                          double *weights);

#endif
