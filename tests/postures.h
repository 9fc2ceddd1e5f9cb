/* SPDX-License-Identifier: GPL-3.0-or-later */
/* What turning a patient does to resting lungs and to their breaths: the figures that are set
 * beside published ones. */
#ifndef SUPINE_TEST_POSTURES_H
#define SUPINE_TEST_POSTURES_H

#include <supine/runtime.h>

enum { POSTURE_COUNT = 6 }; /* supine, prone, left, right, upright, inverted */

/* One posture of lungs at rest. */
typedef struct posture_figures {
  double move_mean, move_max; /* mm, of the vertices from supine rest */
  double move_base, move_top; /* mean over the half nearer the diaphragm, the upper third */
  double volume[2];           /* mL of each lung */
  double change[2];           /* of each lung's volume, from supine rest; 0.1 is 10 % more */
  double turned_over;         /* share of the triangles, from full inflation */
  double dependent; /* what a breath (a fifteenth of full) adds per volume: the lowest quarter of
                       height over the uppermost */
  double breath[2]; /* share of each lung in it */
} posture_figures;

/* Measures a basis of two lungs whose rest is known. */
supine_status postures_measure(const supine_basis *basis, posture_figures figures[POSTURE_COUNT],
                               supine_error *error);

extern const char *const posture_figure_names[POSTURE_COUNT];

#endif
