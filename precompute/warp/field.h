/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * The displacement field on the grid of a basis ('supine embed'), its inverse, and images moved by
 * it. Fields are trilinear between nodes, and 0 at the outermost nodes and beyond them. */
#ifndef SUPINE_FIELD_H
#define SUPINE_FIELD_H

#include <supine/runtime.h>

#include "mesh/image/image.h"

/** Displacement u(x) at the nodes x of a grid, mm. */
typedef struct supine_field {
  supine_image nodes; /**< the displacement u: three F32 channels, mm */
  supine_image depth; /**< depth below the lungs' surface, negative outside: one F32 channel, mm; an
                         inverse field has no depth, and depth.values is NULL */
  supine_image lung;  /**< index of the nearest lung: one U8 channel; no values if depth has none */
} supine_field;

/** Return the distance from the lungs, mm, over which a field falls to 0 if its largest
 * displacement is `largest` mm: 60 mm, or 1.5 times the largest displacement if that is more. */
double supine_warp_fade(double largest);

/** Compute the displacement field from the scan to a pose, plus `deviation` [N, 3], mm, of its
 * vertices from there, or NULL. It has a physical meaning only in the
 * lungs, and at the grid nodes around them to which 'supine embed' extrapolated it. From the lungs
 * it falls to 0 over the distance of supine_warp_fade, and at the latest at the border of the
 * grid.
 * @param field  release with supine_warp_free */
supine_status supine_warp_create(const supine_basis *basis, const supine_pose *pose,
                                 const float *deviation, supine_field *field, supine_error *error);
void supine_warp_free(supine_field *field);

/** Interpolate the field at a point. */
void supine_warp_at(const supine_field *field, const double point[3], double u[3]);

/** Compute the displacement field from a pose (NULL: the scan) to another, as supine_warp_create.
 * Release `field` even after a failure. */
supine_status supine_warp_between(const supine_basis *basis, const supine_pose *from,
                                  const supine_pose *to, const float *deviation,
                                  supine_field *field, supine_error *error);

/** Count the cells that the field u turns over (det(I + du/dx) is not positive at their centre):
 * share[0] in the lungs, share[1] in the body around them, where the field fades out. Both are
 * shares of the number of cells in the lungs. Near each of these cells, voxels are lost. */
void supine_warp_folded(const supine_field *field, double share[2]);

/** Residual u(x) + v(x + u(x)) of a field u and its inverse v. */
typedef struct supine_warp_residual {
  double rms, largest; /**< RMS and largest length of the residual inside the lungs, mm */
  size_t lost; /**< number of nodes at which the inverse errs by more than 0.01 mm, because the
                  field folds there */
} supine_warp_residual;

/** Invert a field u by Newton's method, on the same nodes: v(y) = x - y, where x + u(x) = y. A
 * resampled image takes the value of its voxel y from the place y + v(y). Cost: about ten
 * evaluations of u per node, in parallel. */
supine_status supine_warp_invert(const supine_field *field, supine_field *inverse,
                                 supine_warp_residual *residual, supine_error *error);

/* Find x with x + u(x) = y for the field u by Newton's method, starting from the given x. Return
 * the length of the residual, mm. */
double supine_warp_solve(const supine_field *field, const double y[3], double x[3]);

/** Density below which a voxel near the surface of the lungs belongs to them, HU. All lungs have
 * such voxels. */
extern const double supine_warp_aerated;

/** Return whether an image is in Hounsfield units: at least one voxel is below supine_warp_aerated.
 */
bool supine_warp_is_hounsfield(const supine_image *image);

/** Refuse an image that is not in Hounsfield units.
 * @param path  names the image in the message */
supine_status supine_warp_check_hounsfield(const supine_image *image, const char *path,
                                           supine_error *error);

struct supine_tissue;

/** Move an image: moved(y) = image(y + v(y)) at the voxels y of the image; places outside the image
 * have the value of the nearest voxel. If `tissue` is given, the mass of each lung is kept: the
 * soft share of a voxel (supine_warp_tissue_soft_share) keeps its density (Hounsfield units +
 * 1000), and that of the aerated share is multiplied by k det(I + dv/dy). The determinant is the
 * tissue's volume before the motion, divided by its volume after the motion; k, the same for all
 * voxels of a lung, makes up for soft tissue that the field compresses.
 * @param inverse  field v, made by supine_warp_invert
 * @param tissue   of this image; NULL to keep densities unscaled
 * @param labels   whether to take the value of the nearest voxel instead of interpolating
 * @param moved    release with supine_image_free */
supine_status supine_warp_resample(const supine_field *inverse, const struct supine_tissue *tissue,
                                   bool labels, const supine_image *image, supine_image *moved,
                                   supine_error *error);

/* The cell between eight voxels that contains a point. */
typedef struct supine_warp_cell {
  size_t corner[3]; /* voxel at the lowest corner */
  double share[3];  /* position of the point in the cell, 0 to 1 along each axis */
} supine_warp_cell;

/* Find the cell that contains a point, mm; a point outside the image is clamped to its border. */
void supine_warp_find_cell(const supine_image *image, const double point[3],
                           supine_warp_cell *cell);

/* Return det(I + du/dx) at a point in a cell of the field u. */
double supine_warp_stretch(const supine_image *nodes, const supine_warp_cell *cell);

/* Interpolate all channels of an F32 image at a point in a cell. Unless `slope` is NULL, also
 * compute the derivatives [channels, 3] with respect to cell->share, the position of the point in
 * the cell. */
void supine_warp_interpolate(const supine_image *image, const supine_warp_cell *cell,
                             double *values, double (*slope)[3]);

#endif
