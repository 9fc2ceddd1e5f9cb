/* SPDX-License-Identifier: MIT */
/* Describe the directions of an image's axes. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "mesh/labels/mask.h"

void supine_labels_axes(const double step[3][3], char *text, size_t size) {
  static const char *const ways[3][2] = {{"right", "left"}, {"front", "back"}, {"feet", "head"}};
  text[0] = '\0';
  for (int a = 0; a < 3; ++a) {
    int most = 0;
    for (int k = 1; k < 3; ++k) {
      most = fabs(step[a][k]) > fabs(step[a][most]) ? k : most;
    }
    const size_t used = strlen(text);
    (void)snprintf(text + used, size - used, "%s%c to the %s", a == 0 ? "" : ", ", "ijk"[a],
                   ways[most][step[a][most] > 0.0]);
  }
}
