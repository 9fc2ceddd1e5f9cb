/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Measure the volume of each lung in each run of a simulator, and find which runs share a direction
 * of gravity and which are the n-th smallest volume of their direction. */
#ifndef SUPINE_FIELDS_VOLUMES_H
#define SUPINE_FIELDS_VOLUMES_H

#include "precompute/fields/fields.h"

/** Number the directions of gravity of the runs in the order of their first run. Return how many
 * there are.
 * @param direction  [runs] written */
size_t supine_fields_number_directions(const supine_fields *fields, size_t *direction);

/** Measure the volumes of the runs, map them to -1 to 1, and group the runs.
 * @param fit  its members fields and lungs are read; its members volume, range, parameter, groups,
 *   and the counts of the report are written
 * @retval SUPINE_ERROR_ARGUMENT      two runs have the same direction and the same volume
 * @retval SUPINE_ERROR_OPEN_SURFACE  directions are repeated, but the surface has no volume */
supine_status supine_fields_volumes_measure(supine_fit *fit, supine_error *error);

/** Map the total volume of the lungs in each run to -1 to 1 over all that was simulated.
 * @param total  [runs] written
 * @param range  written: total volumes at -1 and 1, mL above the surface */
void supine_fields_map_totals(const supine_fit *fit, double *total, double range[2]);

#endif
