/* SPDX-License-Identifier: MIT */
/* Internal declarations of the image formats. */
#ifndef SUPINE_IMAGE_FORMATS_H
#define SUPINE_IMAGE_FORMATS_H

#include <stdint.h>
#include <stdio.h>

#include "mesh/image/image.h"

/* How a file stores its voxels. */
typedef struct image_storage {
  int64_t offset; /* start of the voxel data, compressed or not, in the file, bytes */
  int64_t skip;   /* bytes to skip at the start of the decompressed voxel data */
  bool packed;    /* whether the voxels are compressed by zlib or gzip */
  bool text;      /* whether the voxels are decimal numbers */
  bool hex;       /* whether the bytes of the voxels are pairs of hexadecimal digits */
  bool big_endian;
  int integer; /* 1 or -1 if the file has signed or unsigned 64-bit integers; otherwise 0 */
  double slope, intercept; /* voxel = slope x number + intercept; not scaled if slope is 0 */
} image_storage;

/* Read the header from `file`, and fill `storage` and the image except its voxels. */
typedef supine_status image_describe(const char *path, FILE *file, supine_image *image,
                                     image_storage *storage, supine_error *error);
/* Write the header and the voxels. The caller checks the stream for write errors, and sets the
 * error if the memory is short. */
typedef supine_status image_write(const char *path, const supine_image *image, const char *note,
                                  FILE *file, supine_error *error);

image_describe supine_image_describe_nrrd, supine_image_describe_nifti, supine_image_describe_mha;
image_write supine_image_write_nrrd, supine_image_write_nifti, supine_image_write_mha;

/* Read a DICOM segmentation as a label map. */
supine_status supine_image_read_segmentation(const char *path, supine_image *image,
                                             supine_error *error);

/* Formats of compressed streams; the values are zlib's window bits. */
enum { IMAGE_ZLIB = 15, IMAGE_GZIP = 31 };

/* Read the voxels. Refuse more voxels than a file of `file_size` bytes can hold, incomplete
 * streams, and wrong checksums. */
supine_status supine_image_read_voxels(const char *path, FILE *file, size_t file_size,
                                       const image_storage *storage, supine_image *image,
                                       supine_error *error);

/* Compress `head` (the header) and the voxels `values` into the file, in the format IMAGE_ZLIB or
 * IMAGE_GZIP. */
supine_status supine_image_pack(int format, const void *head, size_t head_size,
                                const supine_image *image, const void *values, FILE *file);

/* Parse the number at *text, which may follow blanks, and move *text behind it; return false if
 * there is none. */
bool supine_image_number(const char **text, double *value);

/* Return the size of all voxels together, bytes. */
size_t supine_image_bytes(const supine_image *image);

#endif
