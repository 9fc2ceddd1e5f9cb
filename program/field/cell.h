/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Trilinear interpolation, for the files of this folder. */
#ifndef SUPINE_FIELD_CELL_H
#define SUPINE_FIELD_CELL_H

#include "program/field/field.h"

/* The cell of voxels that contains a point: its first corner, and the point's place in it, 0 to 1.
 */
typedef struct supine_field_cell {
  size_t corner[3];
  double share[3];
} supine_field_cell;

/* Find the cell that contains a point, or for a point outside the nearest cell, at its border. */
void supine_field_find_cell(const supine_image *image, const double point[3],
                            supine_field_cell *cell);

/* Interpolate all channels of an F32 image and, optionally, their derivative [channels, 3] by the
 * shares. */
void supine_field_interpolate(const supine_image *image, const supine_field_cell *cell,
                              double *values, double (*slope)[3]);

#endif
