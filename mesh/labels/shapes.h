/* SPDX-License-Identifier: MIT */
/** @file Make a surface of each label of a map: nodules, airways, lobes. */
#ifndef SUPINE_LABELS_SHAPES_H
#define SUPINE_LABELS_SHAPES_H

#include "mesh/mesh.h"

typedef struct supine_labels_shape {
  unsigned label;
  double mask; /**< volume of the label's voxels, mL */
  supine_mesh surface;
} supine_labels_shape;

/** Make the surface of each wanted label of a map (.nrrd, .nii, .nii.gz, .mha), as
 * supine_labels_surfaces does, but keep all connected pieces and cavities. The distance between
 * vertices is about one voxel or, if that is larger, 1/50 of the cube root of the label's volume.
 * @param wanted  [wanted_count] labels, 1 to 65535; all labels present if the count is 0
 * @param parts   [*count] output in the order of `wanted`, or by ascending label; release with
 *             supine_labels_shapes_free */
supine_status supine_labels_shapes(const char *path, const unsigned *wanted, size_t wanted_count,
                                   supine_labels_shape **parts, size_t *count, supine_error *error);
void supine_labels_shapes_free(supine_labels_shape *parts, size_t count);

#endif
