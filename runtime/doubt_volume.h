/* SPDX-License-Identifier: MIT */
/** @file
 * The volumes that samples of supine/doubt.h hold. */
#ifndef SUPINE_DOUBT_VOLUME_H
#define SUPINE_DOUBT_VOLUME_H

#include <stdbool.h>

#include <supine/runtime.h>

/** The surface of the lungs or, if `depth` is not NULL, a grid in them. */
typedef struct supine_doubt_shape {
  const supine_basis *basis;
  size_t size[3];     /**< nodes of the grid along each axis */
  uint32_t *vertex;   /**< [nodes] index of the vertex at each node, plus 1; 0 if there is none */
  const float *depth; /**< [vertices] below the surface, negative outside, mm */
} supine_doubt_shape;

/** Return the number of doubles of work space that a shape needs. */
size_t supine_doubt_shape_space(const supine_basis *basis);

/** Find the shape of a basis. Return whether it has volumes: embedded points have none. */
bool supine_doubt_shape_prepare(const supine_basis *basis, double *space,
                                supine_doubt_shape *shape);

/** Compute the volume of each lung at positions [N, 3], mm, in mm^3.
 * @param volume    [lungs] written; of a grid that turns axes over, negative
 * @param gradient  [N, 3] its change with each vertex, mm^2, written; NULL to leave it out */
void supine_doubt_shape_volumes(const supine_doubt_shape *shape, const float *xyz, double *volume,
                                float *gradient);

/** Give the corners of each cell of a grid that a sample turns over, and the prediction does not,
 * their mean error. Return whether there was such a cell.
 * @param predicted  [N, 3] mm
 * @param xyz        [N, 3] of the sample, mm; changed */
bool supine_doubt_shape_unfold(const supine_doubt_shape *shape, const float *predicted, float *xyz);

/** Compute the vector area of a triangle, times 2. */
void supine_doubt_area(const float *xyz, const uint32_t *triangle, double area[3]);

#endif
