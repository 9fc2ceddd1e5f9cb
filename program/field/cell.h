/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Trilinear interpolation, for the files of this folder. */
#ifndef SUPINE_FIELD_CELL_H
#define SUPINE_FIELD_CELL_H

#include "program/field/field.h"

/* Cell of voxels that contains a point: index of its first corner, and position of the point in it,
 * 0 to 1 along each axis. */
typedef struct supine_field_cell {
  size_t corner[3];
  double share[3];
} supine_field_cell;

/* Find the cell that contains a point, mm; a point outside the image is clamped to its border. */
void supine_field_find_cell(const supine_image *image, const double point[3],
                            supine_field_cell *cell);

/* Interpolate all channels of an F32 image and their derivatives with respect to the shares,
 * [channels, 3]; a NULL `slope` is not computed. */
void supine_field_interpolate(const supine_image *image, const supine_field_cell *cell,
                              double *values, double (*slope)[3]);

#endif
