/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Points inside the lungs that are observed live: where each was seen last, and the lungs that
 * follow from them (supine/locate.h). */
#ifndef SUPINE_STREAM_SENSORS_H
#define SUPINE_STREAM_SENSORS_H

#include <stdbool.h>

#include <supine/locate.h>

/** What sensors there are; the caller's. */
typedef struct supine_stream_sensor_list {
  const supine_basis *inside; /**< of 'supine embed' */
  size_t count;               /**< at most SUPINE_LOCATE_POINTS_MAX */
  const char **names;         /**< [count] */
  size_t *vertices;           /**< [count] of `inside` */
  double noise;               /**< mm per axis */
  bool ras;                   /**< positions come in RAS */
} supine_stream_sensor_list;

typedef struct supine_stream_sensors supine_stream_sensors;

/** @param list  kept by the caller
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_stream_sensors_create(const supine_stream_sensor_list *list,
                                           supine_stream_sensors **sensors, supine_error *error);
/** NULL is legal. */
void supine_stream_sensors_destroy(supine_stream_sensors *sensors);

/** Take in where a point is seen. Not-a-number makes it unseen.
 * @return false where no sensor has that name */
bool supine_stream_sensors_take(supine_stream_sensors *sensors, const char *name,
                                const double position[3]);

/** Find the lungs in a posture from all points seen so far.
 * @param state     volume DEFAULT: found
 * @param location  written; valid until the next call; NULL where no point was seen yet
 * @retval those of supine_locate */
supine_status supine_stream_sensors_locate(supine_stream_sensors *sensors,
                                           const supine_state *state,
                                           const supine_location **location, supine_error *error);

#endif
