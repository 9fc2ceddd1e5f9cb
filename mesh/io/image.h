/* SPDX-License-Identifier: MIT */
/** @file Read and write images and label maps in three dimensions: NRRD, NIfTI and MetaImage, in
 * millimetres and LPS whatever the file's axes. */
#ifndef SUPINE_IMAGE_H
#define SUPINE_IMAGE_H

#include <stdbool.h>
#include <stddef.h>

#include "mesh/mesh.h"

/** Storage type of a voxel. */
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

/** Voxel (i, j, k), at values[c + channels (i + size[0] (j + size[1] k))], has its centre at
 *
 *     origin + i step[0] + j step[1] + k step[2]
 *
 * Zero-initialise; supine_image_free frees the voxels. */
typedef struct supine_image {
  size_t size[3];
  double origin[3];  /**< mm, LPS */
  double step[3][3]; /**< mm, LPS, linearly independent */
  supine_image_voxel voxel;
  size_t channels; /**< numbers per voxel: 1 when read; 3 for a displacement field */
  void *values;
  supine_axes axes;         /**< axes assumed for the header's coordinates */
  const char *frame_source; /**< header field that gives the frame: "sform", "qform", "space
                                 directions" or "TransformMatrix", a literal */
  bool frames_differ;       /**< NIfTI: qform and sform differ by half a voxel or more somewhere */
} supine_image;

/** Report whether the name ends in .nrrd, .nii, .nii.gz or .mha. */
bool supine_image_supports(const char *path);

/** Report whether the name ends in one of those or in .mhd, .nhdr, .mgz, .dcm, .hdr or .img, image
 * formats that are not supported. */
bool supine_image_is_named(const char *path);

/** Read an image of one number per voxel. A NIfTI image's slope and intercept are applied, to
 * F32.
 * @param image  zero-initialised; written only on success
 * @retval SUPINE_ERROR_READ    missing or unreadable
 * @retval SUPINE_ERROR_FORMAT  an unsupported ending; truncated or malformed; more
 *         voxels than the file can hold; not three dimensions, or several numbers a voxel; voxels
 *         of another type; no orientation in the header, or one that is not a frame; an NRRD header
 *         that names other files
 * @retval SUPINE_ERROR_MEMORY
 * Memory: the voxels, no more than 1,032 times the file's size (what gzip can make of it). */
supine_status supine_image_read(const char *path, supine_image *image, supine_error *error);
void supine_image_free(supine_image *image);

/** Write an image in the format of its name, whole or not at all; .nrrd, .nii.gz and .mha
 * compressed. Three channels are a displacement, mm, LPS in every format, as ITK and ANTs read
 * them.
 * @param note  optional: one line for the header
 * @retval SUPINE_ERROR_ARGUMENT  another ending, or too large or too many channels for NIfTI-1
 * @retval SUPINE_ERROR_WRITE, SUPINE_ERROR_MEMORY */
supine_status supine_image_write(const char *path, const supine_image *image, const char *note,
                                 supine_error *error);

/** Return the size of one number, bytes. */
size_t supine_image_voxel_size(supine_image_voxel voxel);
/** Read a number as a double. */
double supine_image_get(const supine_image *image, size_t index);
/** Read the numbers at from + index[0 .. count - 1] as doubles. */
void supine_image_gather(const supine_image *image, size_t from, const size_t *index, size_t count,
                         double *values);
/** Store `count` numbers from `begin` on, rounded and clipped to the type. */
void supine_image_put(supine_image *image, size_t begin, size_t count, const double *values);

/** Interpret the coordinates of the header in these axes instead of its own; AUTO: no change. */
void supine_image_set_axes(supine_image *image, supine_axes axes);

/** Compute the centre of voxel `index` = i + size[0] (j + size[1] k), mm, LPS. */
void supine_image_place(const supine_image *image, size_t index, double point[3]);

/** Convert a point, mm, LPS, to voxel coordinates: (0, 0, 0) is the centre of the first voxel. */
void supine_image_locate(const supine_image *image, const double point[3], double voxel[3]);

#endif
