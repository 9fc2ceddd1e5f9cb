/* SPDX-License-Identifier: MIT */
/* Internal declarations of the image formats. */
#ifndef SUPINE_IMAGE_FORMATS_H
#define SUPINE_IMAGE_FORMATS_H

#include "mesh/io/image.h"

/* Refuse an image that is empty, or that a file of `file_size` bytes cannot hold:
 * SUPINE_ERROR_FORMAT. */
supine_status supine_image_check_size(const char *path, const supine_image *image, size_t file_size,
                                      supine_error *error);

/* Read a gzip stream from `offset`, bytes, of a file to its end. Return SUPINE_ERROR_FORMAT unless
 * the stream is complete and its checksum is right. */
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

/* Convert 64-bit integers to doubles in place. */
void supine_image_widen(void *values, size_t count, bool is_signed);

#endif
