/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Read observed points, and find them by name among the points that 'supine embed' made. */
#ifndef SUPINE_COMMAND_OBSERVED_H
#define SUPINE_COMMAND_OBSERVED_H

#include <supine/locate.h>

#include "program/inside.h"
#include "program/stream/server.h"

typedef struct supine_command_observed {
  size_t count;
  supine_observation *points;
} supine_command_observed;

/* Read a CSV file with the columns name, x, y, z.
 * @param observed  zeroed
 * @retval SUPINE_ERROR_FORMAT  an unknown name, the name of a mesh, no point or too many, a number
 *                              that is not finite (line named)
 * @retval SUPINE_ERROR_READ, SUPINE_ERROR_MEMORY */
supine_status supine_command_observed_load(const char *path, const supine_basis *inside,
                                           const supine_command_names *names, double noise,
                                           supine_command_observed *observed, supine_error *error);

/* List the single points, whose positions messages may set, as not seen yet.
 * @param noise    standard deviation of a coordinate, mm
 * @param observed  zeroed; the caller frees its space
 * @retval SUPINE_ERROR_FORMAT  none, or more than SUPINE_LOCATE_POINTS_MAX
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_command_observed_names(const char *path, const supine_basis *inside,
                                            const supine_command_names *names, double noise,
                                            supine_stream_observed *observed, supine_error *error);

void supine_command_observed_free(supine_command_observed *observed);

#endif
