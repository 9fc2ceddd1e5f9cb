/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Find the lungs from observed points, in a given posture or in the most probable of six. */
#ifndef SUPINE_COMMAND_LOCATED_H
#define SUPINE_COMMAND_LOCATED_H

#include <supine/locate.h>

enum { SUPINE_LOCATED_POSTURES = 6 };

typedef struct supine_command_located {
  size_t count;                                      /* postures tried */
  supine_location location[SUPINE_LOCATED_POSTURES]; /* of each */
  double share[SUPINE_LOCATED_POSTURES];             /* its probability, given the points */
  const supine_location *best;
  supine_locate_residual *residuals; /* [points] of the most probable posture */
  float *xyz, *sigma;                /* [N, 3] and [N] of that posture; errors include all */
  void *space;                       /* workspaces of supine_locate */
} supine_command_located;

/* Find the lungs, and the positions [N, 3] of the basis `shown` in them.
 * @param posture_given  else the task's gravity is tried as each of the six named postures
 * @param located        zeroed; free it in any case
 * @retval those of supine_locate, SUPINE_ERROR_MEMORY */
supine_status supine_command_located_find(const supine_locate_task *task, bool posture_given,
                                          const supine_basis *shown,
                                          supine_command_located *located, supine_error *error);
void supine_command_located_free(supine_command_located *located);

/* Print posture and volume, and how well the points determine both. */
void supine_command_located_tell(const supine_command_located *located, bool posture_given);

#endif
