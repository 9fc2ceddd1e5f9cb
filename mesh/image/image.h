/* SPDX-License-Identifier: MIT */
/** @file
 * Images and label maps in three dimensions: NRRD, NIfTI and MetaImage, read and written, in
 * millimetres and LPS whatever axes the file is in. */
#ifndef SUPINE_IMAGE_H
#define SUPINE_IMAGE_H

#include <stdbool.h>
#include <stddef.h>

#include "mesh/mesh.h"

/** How a voxel is stored. */
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
 * Zero-initialise; supine_image_free releases what was read. */
typedef struct supine_image {
  size_t size[3];
  double origin[3];  /**< mm, LPS */
  double step[3][3]; /**< mm, LPS, linearly independent */
  supine_image_voxel voxel;
  size_t channels; /**< numbers a voxel: 1 where read; 3 for a displacement field */
  void *values;
  supine_axes axes;         /**< that the header's coordinates are in, of what was read */
  const char *frame_source; /**< where the frame of a file was: "sform", "qform" or "space
                                 directions", a literal */
  bool frames_differ;       /**< a NIfTI file's other form puts some voxel half a voxel away */
} supine_image;

/** Does the name end in .nrrd, .nii, .nii.gz or .mha? */
bool supine_image_supports(const char *path);

/** Or as those of other formats do (.mhd, .nhdr, .mgz, .dcm, .hdr, .img), which are told that
 * they are not read: of none is a C library at hand that is kept up. */
bool supine_image_is_named(const char *path);

/** Reads an image of one number a voxel. A NIfTI image's slope and intercept are applied, to F32.
 * @param image  zero-initialised; written on success alone
 * @retval SUPINE_ERROR_READ    missing or unreadable
 * @retval SUPINE_ERROR_FORMAT  none of these by its name; truncated or malformed; more
 *         voxels than the file can hold; not three dimensions, or several numbers a voxel; voxels
 *         of another type; no orientation in the header, or one that is not a frame; an NRRD header
 *         that names other files
 * @retval SUPINE_ERROR_MEMORY
 * Memory: the voxels, no more than 1,032 times the file's size (what gzip can make of it). */
supine_status supine_image_read(const char *path, supine_image *image, supine_error *error);
void supine_image_free(supine_image *image);

/** Writes an image as its name says, whole or not at all; .nrrd, .nii.gz and .mha compressed. Three
 * channels are a displacement, mm, LPS in every format, as ITK and ANTs read them.
 * @param note  optional: one line for the header
 * @retval SUPINE_ERROR_ARGUMENT  another name, or too large or too many channels for NIfTI-1
 * @retval SUPINE_ERROR_WRITE, SUPINE_ERROR_MEMORY */
supine_status supine_image_write(const char *path, const supine_image *image, const char *note,
                                 supine_error *error);

/** Bytes of one number. */
size_t supine_image_voxel_size(supine_image_voxel voxel);
/** A number as a double. */
double supine_image_get(const supine_image *image, size_t index);
/** The same for the numbers from + index[0 .. count - 1], or for `count` of them from `begin`. */
void supine_image_gather(const supine_image *image, size_t from, const size_t *index, size_t count,
                         double *values);
/** Store `count` numbers from `begin` on, rounded and clipped to the type. */
void supine_image_put(supine_image *image, size_t begin, size_t count, const double *values);

/** Takes the header's coordinates for coordinates in other axes than it says; AUTO: no change. */
void supine_image_set_axes(supine_image *image, supine_axes axes);

/** Compute where voxel `index`, i + size[0] (j + size[1] k), has its centre, mm. */
void supine_image_place(const supine_image *image, size_t index, double point[3]);

/** Coordinates of a point in voxels: (0, 0, 0) is the first voxel's centre. */
void supine_image_locate(const supine_image *image, const double point[3], double voxel[3]);

#endif
