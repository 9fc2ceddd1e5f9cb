/* SPDX-License-Identifier: MIT */
/* The two formats, for the files of this folder; no other folder sees it. */
#ifndef SUPINE_IMAGE_FORMATS_H
#define SUPINE_IMAGE_FORMATS_H

#include "mesh/image/image.h"

/* What gzip makes of a byte at most. */
enum { SUPINE_IMAGE_GZIP_RATIO = 1032 };

/* Bytes of the image, or 0 where that is more than a file of `file_size` bytes can hold. */
size_t supine_image_bytes(const supine_image *image, size_t file_size);

supine_status supine_image_read_nrrd(const char *path, size_t file_size, supine_image *image,
                                     supine_error *error);
supine_status supine_image_read_nifti(const char *path, size_t file_size, supine_image *image,
                                      supine_error *error);
supine_status supine_image_write_nrrd(const char *path, const supine_image *image, const char *note,
                                      supine_error *error);
supine_status supine_image_write_nifti(const char *path, bool compressed, const supine_image *image,
                                       const char *note, supine_error *error);

#endif
