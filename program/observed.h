/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Observed points, by the names that 'supine embed' was given. */
#ifndef SUPINE_COMMAND_OBSERVED_H
#define SUPINE_COMMAND_OBSERVED_H

#include <supine/locate.h>

#include "program/names.h"

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
void supine_command_observed_free(supine_command_observed *observed);

#endif
