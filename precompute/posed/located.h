/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Locate one person's lungs in the posture that explains a few observed points best. */
#ifndef SUPINE_POSED_LOCATED_H
#define SUPINE_POSED_LOCATED_H

#include <supine/locate.h>

#include "base/arena.h"

enum { SUPINE_POSED_POSTURES = 6 };

/* Located lungs. Initialise to zero, and release with supine_posed_located_free. */
typedef struct supine_posed_located {
  size_t count; /* number of postures tried */
  const supine_location *location[SUPINE_POSED_POSTURES];
  double probability[SUPINE_POSED_POSTURES];
  size_t most_probable;                  /* index of the most probable posture */
  const supine_location_info *best;      /* fit in that posture */
  double best_probability;               /* 1 if the posture was given */
  supine_locate_residual *residuals;     /* [points] residual of each observed point in that fit */
  float *xyz;                            /* [N, 3] positions in the most probable posture, mm */
  float *sigma;                          /* [N] expected errors of the positions, mm */
  double expected_rms, expected_largest; /* RMS and maximum of `sigma`, mm */
  supine_arena arena;
} supine_posed_located;

/* Fit the lungs to observed points, and compute the positions of the vertices of `shown`. If points
 * that do not fit fit ten times better (mean squared residual) when they are read in centimetres,
 * in RAS or mirrored, the error says so. Other statuses: as supine_locate.
 * @param posture_given  whether task->state has the posture; otherwise, six postures are tried, and
 *   the expected errors include the differences between them
 * @param shown          task->inside, or the lungs around it */
supine_status supine_posed_locate(const supine_locate_task *task, bool posture_given,
                                  const supine_basis *shown, supine_posed_located *located,
                                  supine_error *error);
void supine_posed_located_free(supine_posed_located *located);

#endif
