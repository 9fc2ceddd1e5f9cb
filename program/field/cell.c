/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Trilinear interpolation. */
#include <math.h>

#include "program/field/cell.h"

void supine_field_find_cell(const supine_image *image, const double point[3],
                            supine_field_cell *cell) {
  double voxel[3];
  supine_image_locate(image, point, voxel);
  for (size_t a = 0; a < 3; ++a) {
    const double last = (double)image->size[a] - 1.0;
    const double at = fmin(fmax(voxel[a], 0.0), last);
    const double corner = fmin(floor(at), fmax(last - 1.0, 0.0));
    cell->corner[a] = (size_t)corner;
    cell->share[a] = at - corner;
  }
}

void supine_field_interpolate(const supine_image *image, const supine_field_cell *cell,
                              double *values, double (*slope)[3]) {
  const float *numbers = image->values;
  for (size_t c = 0; c < image->channels; ++c) {
    values[c] = 0.0;
    for (size_t k = 0; k < 3 && slope != NULL; ++k) {
      slope[c][k] = 0.0;
    }
  }
  for (size_t corner = 0; corner < 8; ++corner) {
    double weight[3];
    size_t at[3];
    for (size_t a = 0; a < 3; ++a) {
      const size_t up = corner >> a & 1U;
      weight[a] = up ? cell->share[a] : 1.0 - cell->share[a];
      at[a] = cell->corner[a] + up;
      at[a] -= at[a] == image->size[a]; /* a one-slice image: the next slice has weight 0 */
    }
    const size_t voxel = at[0] + image->size[0] * (at[1] + image->size[1] * at[2]);
    for (size_t c = 0; c < image->channels; ++c) {
      const double value = (double)numbers[image->channels * voxel + c];
      values[c] += weight[0] * weight[1] * weight[2] * value;
      for (size_t k = 0; k < 3 && slope != NULL; ++k) {
        const double sign = corner >> k & 1U ? 1.0 : -1.0;
        slope[c][k] += sign * weight[(k + 1) % 3] * weight[(k + 2) % 3] * value;
      }
    }
  }
}
