/* SPDX-License-Identifier: MIT */
/** @file
 * The labels of a map, each as a surface of its own: nodules, airways, lobes. */
#ifndef SUPINE_LABELS_SHAPES_H
#define SUPINE_LABELS_SHAPES_H

#include "mesh/mesh.h"

typedef struct supine_labels_shape {
  unsigned label;
  double mask;     /**< mL of its voxels */
  double farthest; /**< mm from the voxels' surface to a vertex, at most */
  supine_mesh surface;
} supine_labels_shape;

/** The surfaces of some labels of a map (.nrrd, .nii, .nii.gz), each a surface net as of
 * supine_labels_surfaces, of all its pieces and with its cavities, as fine as the voxels, and of
 * large parts a fiftieth of the cube root of the volume.
 * @param wanted  labels, 1 to 65535; their count 0: all that are there but 0
 * @param parts   [*count] written, in the order wanted or of the labels; supine_labels_shapes_free
 * @retval SUPINE_ERROR_MESH    a label that is not there, or none at all
 * @retval SUPINE_ERROR_FORMAT  voxels that are no labels
 * @retval SUPINE_ERROR_MEMORY, and those of supine_image_read */
supine_status supine_labels_shapes(const char *path, const unsigned *wanted, size_t wanted_count,
                                   supine_labels_shape **parts, size_t *count, supine_error *error);
void supine_labels_shapes_free(supine_labels_shape *parts, size_t count);

#endif
