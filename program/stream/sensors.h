/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Points observed inside the lungs, from which the lungs are located (supine/locate.h). */
#ifndef SUPINE_STREAM_SENSORS_H
#define SUPINE_STREAM_SENSORS_H

#include <stdbool.h>

#include <supine/locate.h>

typedef struct supine_stream_sensors {
  const supine_basis *inside; /**< basis made by 'supine embed' */
  size_t count;
  const char *name[SUPINE_LOCATE_POINTS_MAX];
  supine_observation last[SUPINE_LOCATE_POINTS_MAX]; /**< last position; not-a-number: not seen */
  bool ras;                                          /**< positions come in RAS */
  double *space;                                     /**< [supine_locate_space(count)] workspace */
  supine_location location;
} supine_stream_sensors;

#endif
