/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * The displacement field over a grid that 'supine embed' made: where the tissue of each node goes,
 * its inverse, and images moved by it. Between nodes fields are trilinear, and beyond the outermost
 * ones as there. */
#ifndef SUPINE_FIELD_H
#define SUPINE_FIELD_H

#include <supine/runtime.h>

#include "mesh/image/image.h"

/** u(x) at the nodes x of a grid, mm. */
typedef struct supine_field {
  supine_image nodes; /**< three channels, F32 */
  supine_image
      depth; /**< one, F32: mm below the lungs' surface, negative outside; none of an inverse */
} supine_field;

/** The field of a basis's grid in a pose, from the scan. Outside the lungs, beyond the nodes that
 * the basis has, it fades out to 0 over `fade` mm: smooth to look at, but it means nothing there.
 * @param field  written; release with supine_field_free
 * @retval SUPINE_ERROR_FORMAT  the basis is of no grid, or its grid is malformed
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_field_create(const supine_basis *basis, const supine_pose *pose, double fade,
                                  supine_field *field, supine_error *error);
void supine_field_free(supine_field *field);

/** u at any point. */
void supine_field_at(const supine_field *field, const double point[3], double u[3]);

/** Residual of the field followed by its inverse. */
typedef struct supine_field_residual {
  double rms, largest; /**< mm, over the nodes inside: |u(x) + v(x + u(x))| */
  size_t lost; /**< nodes of the inverse at which none was found to 0.01 mm: the field folds */
} supine_field_residual;

/** The inverse v on the same nodes: v(y) = x - y where x + u(x) = y, by Newton's steps. What a
 * resampled image takes its voxel at y from is y + v(y).
 * @retval SUPINE_ERROR_MEMORY
 * Cost: some ten evaluations a node, in parallel. */
supine_status supine_field_invert(const supine_field *field, supine_field *inverse,
                                  supine_field_residual *residual, supine_error *error);

/** moved(y) = image(y + v(y)) on the image's own voxels; where that lies outside the image, the
 * nearest of its voxels. With a depth, that of the field, densities (Hounsfield units + 1000)
 * inside the lungs are multiplied by det(dv/dy + 1), the volume that the tissue had of that it has
 * now, so that its mass is kept; outside, where the field means nothing, they stay.
 * @param inverse  of supine_field_invert
 * @param depth    NULL: densities are not scaled
 * @param labels   nearest voxel instead of linear
 * @param moved    written; supine_image_free releases it
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_field_resample(const supine_field *inverse, const supine_image *depth,
                                    bool labels, const supine_image *image, supine_image *moved,
                                    supine_error *error);

#endif
