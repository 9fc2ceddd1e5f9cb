/* SPDX-License-Identifier: MIT */
/* Does the header's orientation agree with what lungs look like? */
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

/* Widest extent in x of the vertices with z in a range, and the middle of their y. */
static void layer(const supine_mesh *mesh, double from, double to, double *width, double *y) {
  double low = INFINITY;
  double high = -INFINITY;
  double sum = 0.0;
  double count = 0.0;
  for (size_t i = 0; i < mesh->vertex_count; ++i) {
    const double *p = mesh->vertices + 3 * i;
    if (p[2] >= from && p[2] <= to) {
      low = fmin(low, p[0]);
      high = fmax(high, p[0]);
      sum += p[1];
      count += 1.0;
    }
  }
  *width = high - low;
  *y = sum / count;
}

/* Of eight lungs of five people the lowest 15 % are 1.3 to 1.7 times as wide as the uppermost, and
 * the middle of the lowest 10 % lies at 0.67 to 0.88 of the way to the back. */
void supine_labels_anatomy(const supine_mesh *surfaces, supine_labels_report *report) {
  static const double ends = 0.15;
  static const double deep = 0.1;
  static const double clearly = 1.15;
  static const double backwards = 0.58;
  double ratio = 1.0;
  double behind = 0.0;
  for (size_t lung = 0; lung < report->lung_count; ++lung) {
    double low[3];
    double high[3];
    double width[2];
    double y;
    double unused;
    supine_mesh_box(&surfaces[lung], low, high);
    const double height = high[2] - low[2];
    layer(&surfaces[lung], low[2], low[2] + ends * height, &width[0], &y);
    layer(&surfaces[lung], high[2] - ends * height, high[2], &width[1], &y);
    layer(&surfaces[lung], low[2], low[2] + deep * height, &unused, &y);
    ratio *= width[0] / width[1];
    behind += (y - low[1]) / (high[1] - low[1]) / (double)report->lung_count;
  }
  ratio = pow(ratio, 1.0 / (double)report->lung_count);
  report->apex = ratio > clearly ? 1 : ratio < 1.0 / clearly ? -1 : 0;
  report->back = behind > backwards ? 1 : behind < 1.0 - backwards ? -1 : 0;
}
