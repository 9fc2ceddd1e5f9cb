/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Store the last positions of points observed inside the lungs, and locate the lungs from them
 * (supine/locate.h). */
#ifndef SUPINE_STREAM_SENSORS_H
#define SUPINE_STREAM_SENSORS_H

#include <stdbool.h>

#include <supine/locate.h>

/** The sensors; owned by the caller. */
typedef struct supine_stream_sensor_list {
  const supine_basis *inside; /**< basis made by 'supine embed' */
  size_t count;               /**< at most SUPINE_LOCATE_POINTS_MAX */
  const char **names;         /**< [count] */
  size_t *vertices;           /**< [count] of `inside` */
  double noise;               /**< standard deviation, mm per axis */
  bool ras;                   /**< positions come in RAS */
} supine_stream_sensor_list;

typedef struct supine_stream_sensors supine_stream_sensors;

/** Create sensors of which none is seen yet.
 * @param list  must outlive them
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_stream_sensors_create(const supine_stream_sensor_list *list,
                                           supine_stream_sensors **sensors, supine_error *error);
/** NULL is legal. */
void supine_stream_sensors_destroy(supine_stream_sensors *sensors);

/** Store the position of a point; not-a-number marks it as not seen.
 * @return false where no sensor has that name */
bool supine_stream_sensors_take(supine_stream_sensors *sensors, const char *name,
                                const double position[3]);

/** Locate the lungs in a posture from all points seen.
 * @param state     volume DEFAULT: fitted
 * @param location  valid until the next call; NULL where no point was seen
 * @retval those of supine_locate */
supine_status supine_stream_sensors_locate(supine_stream_sensors *sensors,
                                           const supine_state *state,
                                           const supine_location **location, supine_error *error);

#endif
