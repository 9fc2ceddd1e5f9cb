/* SPDX-License-Identifier: MIT */
/* The formats, for the files of this folder; no other folder sees it. */
#ifndef SUPINE_IMAGE_FORMATS_H
#define SUPINE_IMAGE_FORMATS_H

#include "mesh/image/image.h"

/* What gzip makes of a byte at most. */
enum { SUPINE_IMAGE_GZIP_RATIO = 1032 };

/* Bytes of the image, or 0 where that is more than a file of `file_size` bytes can hold. */
size_t supine_image_bytes(const supine_image *image, size_t file_size);

/* Reads a gzip stream from `offset` of a file to its end: SUPINE_ERROR_FORMAT unless it is whole
 * and its checksum right. */
supine_status supine_image_check_gzip(const char *path, long offset, supine_error *error);

supine_status supine_image_read_nrrd(const char *path, size_t file_size, supine_image *image,
                                     supine_error *error);
supine_status supine_image_read_nifti(const char *path, size_t file_size, supine_image *image,
                                      supine_error *error);
supine_status supine_image_write_nrrd(const char *path, const supine_image *image, const char *note,
                                      supine_error *error);
supine_status supine_image_write_nifti(const char *path, const supine_image *image,
                                       const char *note, supine_error *error);

/* MetaImage, .mha. */
supine_status supine_image_read_mha(const char *path, size_t file_size, supine_image *image,
                                    supine_error *error);
supine_status supine_image_write_mha(const char *path, const supine_image *image, const char *note,
                                     supine_error *error);

/* Makes doubles of 64-bit integers, in their place. */
void supine_image_widen(void *values, size_t count, bool is_signed);

#endif
