/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute moments of the animations of a model. */
#include "program/view/export/moments.h"

#include <math.h>

static const double pi = 3.14159265358979323846;

double supine_export_roll(double seconds) {
  const double stage = floor(seconds / EXPORT_SECONDS);
  const double x = fmax(0, 2 * (seconds / EXPORT_SECONDS - stage) - 1);
  return pi / 2 * (stage + x * x * (3 - 2 * x));
}

void supine_export_moment(const export_targets *targets, double roll, double seconds, size_t lung,
                          double *weights) {
  const double gravity[3] = {sin(roll), cos(roll), 0};
  const double fraction = 0.5 - 0.5 * cos(2 * pi * seconds / EXPORT_BREATH_SECONDS);
  supine_pose pose;
  /* No failure is expected, because supine_export_targets_choose has checked this breath. */
  (void)supine_export_breath_pose(targets->basis, targets->breath, gravity, fraction, &pose, NULL);
  supine_export_targets_weights(targets, &pose, lung, weights);
}
