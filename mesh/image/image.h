/* SPDX-License-Identifier: MIT */
/** @file Read and write three-dimensional images and label maps (NRRD, NIfTI and MetaImage), and
 * read DICOM segmentations. In memory, positions are in mm and LPS, whatever axes the file has. */
#ifndef SUPINE_IMAGE_H
#define SUPINE_IMAGE_H

#include <stdbool.h>
#include <stddef.h>

#include "mesh/mesh.h"

typedef enum supine_image_voxel {
  SUPINE_VOXEL_I8 = 0,
  SUPINE_VOXEL_U8,
  SUPINE_VOXEL_I16,
  SUPINE_VOXEL_U16,
  SUPINE_VOXEL_I32,
  SUPINE_VOXEL_U32,
  SUPINE_VOXEL_F32,
  SUPINE_VOXEL_F64,
  SUPINE_VOXEL_COUNT
} supine_image_voxel;

/** An image. Channel c of voxel (i, j, k) is values[c + channels (i + size[0] (j + size[1] k))];
 * the voxel's centre is at
 *
 *     origin + i step[0] + j step[1] + k step[2]
 *
 * Zero-initialise; supine_image_free frees the voxels. */
typedef struct supine_image {
  size_t size[3];
  double origin[3];  /**< centre of voxel (0, 0, 0), mm, LPS */
  double step[3][3]; /**< vector to the next voxel along each axis, mm, LPS; linearly independent */
  supine_image_voxel voxel;
  size_t channels; /**< numbers per voxel: 1 when read from a file, 3 in a displacement field */
  void *values;
  supine_axes axes;         /**< axes assumed for the coordinates in the header */
  const char *frame_source; /**< header field that gives origin and steps, a string literal:
                               "sform", "qform", "space directions" or "TransformMatrix" */
  /** Whether the file is a DICOM segmentation, whose voxels have the numbers of their segments. */
  bool is_segmentation;
  char lungs[256];    /**< its lungs, if its codes name them: "left=3+4,right=5"; otherwise "" */
  bool frames_differ; /**< whether a NIfTI file's qform and sform differ by half a voxel or more */
} supine_image;

/** Return the number of voxels. */
static inline size_t supine_image_count(const supine_image *image) {
  return image->size[0] * image->size[1] * image->size[2];
}

/** Return whether the name ends in .nrrd, .nii, .nii.gz or .mha. */
bool supine_image_supports(const char *path);

/** Return whether the name's ending is that of any image format, even one that cannot be read. */
bool supine_image_is_named(const char *path);

/** Read an image of one number per voxel, or a DICOM segmentation (.dcm) by DCMTK's dcm2json. If a
 * segmentation names lungs by their codes, its other segments are skipped. If a NIfTI header gives
 * a slope and an intercept, the voxels are scaled and stored as F32. Files that refer to other
 * files, or have no orientation, are refused.
 * @param image  zero-initialised; written only on success
 * Memory: the voxels, at most 1,032 times the file's size, because gzip expands no further. */
supine_status supine_image_read(const char *path, supine_image *image, supine_error *error);
void supine_image_free(supine_image *image);

/** Write an image in the format of its name's ending; .nrrd, .nii.gz and .mha are compressed. The
 * file appears completely or not at all. An image of three channels is a field of
 * displacements, which every format stores in mm and LPS, as ITK and ANTs expect, and on a
 * right-handed grid: if need be, its first axis is reversed. Other images keep their voxels' order.
 * @param note  optional: one line for the header */
supine_status supine_image_write(const char *path, const supine_image *image, const char *note,
                                 supine_error *error);

/** Return the size in bytes of a number of this type. */
size_t supine_image_voxel_size(supine_image_voxel voxel);
/** Return values[index] as a double. */
double supine_image_get(const supine_image *image, size_t index);
/** Set values[k] to supine_image_get(image, from + index[k]) for 0 <= k < count. */
void supine_image_gather(const supine_image *image, size_t from, const size_t *index, size_t count,
                         double *values);
/** Set value begin + i of the image to values[i], 0 <= i < count; integers are rounded and
 * clipped. */
void supine_image_put(supine_image *image, size_t begin, size_t count, const double *values);

/** Assume `axes` for the coordinates in the header, and recompute the origin and the steps. If
 * `axes` is AUTO, change nothing. */
void supine_image_set_axes(supine_image *image, supine_axes axes);

/** Compute the centre of voxel `index` = i + size[0] (j + size[1] k), mm, LPS. */
void supine_image_place(const supine_image *image, size_t index, double point[3]);

/** Return the distance, mm, between neighbouring planes of voxels that the axis `axis` crosses. It
 * is less than the length of the step if the axes are not at right angles, as in a tilted CT. */
double supine_image_plane_distance(const supine_image *image, size_t axis);

/** Return the longest diagonal, mm, of the cell between eight voxels. */
double supine_image_cell_diagonal(const supine_image *image);

/** Return whether two images have the same size, and corners that differ by at most 0.01 voxels. */
bool supine_image_same_grid(const supine_image *a, const supine_image *b);

/** Return whether the determinant of the steps is negative, as in a file whose axes run to the
 * left, the front and the head (LAS), which dcm2niix writes. DICOM has no such grids, and programs
 * that convert to it mirror them. */
bool supine_image_is_left_handed(const supine_image *image);

/** Reverse an axis: the voxels, if there are any, and the frame, so that each voxel stays where it
 * is in the patient. */
void supine_image_reverse(supine_image *image, size_t axis);

/** Convert a point, mm, LPS, to voxel coordinates: (0, 0, 0) is the centre of the first voxel. */
void supine_image_locate(const supine_image *image, const double point[3], double voxel[3]);

#endif
