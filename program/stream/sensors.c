/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Store observed points, and locate the lungs from them. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "program/stream/sensors.h"

struct supine_stream_sensors {
  const supine_stream_sensor_list *list;
  supine_observation *last; /* [count] last position of each sensor; NaN: not seen */
  supine_observation *seen; /* [count] workspace: the sensors that are seen */
  supine_locate_residual *residuals;
  double *space; /* workspace of supine_locate */
  supine_location location;
};

supine_status supine_stream_sensors_create(const supine_stream_sensor_list *list,
                                           supine_stream_sensors **sensors, supine_error *error) {
  supine_stream_sensors *s = calloc(1, sizeof *s);
  if (s != NULL) {
    s->list = list;
    s->last = calloc(list->count, sizeof *s->last);
    s->seen = calloc(list->count, sizeof *s->seen);
    s->residuals = calloc(list->count, sizeof *s->residuals);
    s->space = calloc(supine_locate_space(list->count), sizeof *s->space);
  }
  if (s == NULL || s->last == NULL || s->seen == NULL || s->residuals == NULL || s->space == NULL) {
    supine_stream_sensors_destroy(s);
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "out of memory");
  }
  for (size_t i = 0; i < list->count; ++i) {
    s->last[i] = (supine_observation){
        .vertex = list->vertices[i], .position = {(double)NAN}, .noise = list->noise};
  }
  *sensors = s;
  return SUPINE_OK;
}

void supine_stream_sensors_destroy(supine_stream_sensors *sensors) {
  if (sensors != NULL) {
    free(sensors->last);
    free(sensors->seen);
    free(sensors->residuals);
    free(sensors->space);
    free(sensors);
  }
}

bool supine_stream_sensors_take(supine_stream_sensors *sensors, const char *name,
                                const double position[3]) {
  const supine_stream_sensor_list *list = sensors->list;
  size_t at = 0;
  while (at < list->count && strcmp(list->names[at], name) != 0) {
    ++at;
  }
  if (at == list->count) {
    return false;
  }
  for (size_t i = 0; i < 3; ++i) {
    sensors->last[at].position[i] = list->ras && i < 2 ? -position[i] : position[i];
  }
  return true;
}

supine_status supine_stream_sensors_locate(supine_stream_sensors *sensors,
                                           const supine_state *state,
                                           const supine_location **location, supine_error *error) {
  supine_locate_task task = {
      .inside = sensors->list->inside, .observed = sensors->seen, .state = *state};
  *location = NULL;
  for (size_t i = 0; i < sensors->list->count; ++i) {
    const double *p = sensors->last[i].position;
    if (isfinite(p[0] + p[1] + p[2])) {
      sensors->seen[task.count++] = sensors->last[i];
    }
  }
  if (task.count == 0) {
    return SUPINE_OK;
  }
  const supine_status status =
      supine_locate(&task, sensors->residuals, sensors->space, &sensors->location, error);
  *location = status == SUPINE_OK ? &sensors->location : NULL;
  return status;
}
