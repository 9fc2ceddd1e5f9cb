/* SPDX-License-Identifier: MIT */
/** @file
 * Safetensors files inside this folder: element types, an open file, checksums. */
#ifndef SUPINE_SAFETENSORS_FILE_H
#define SUPINE_SAFETENSORS_FILE_H

#include <stdbool.h>

#include <supine/safetensors.h>

#include "runtime/safetensors/platform.h"

/** Characters of a stated checksum, with the NUL. */
enum { CHECKSUM_SIZE = 23 };

struct supine_safetensors {
  const unsigned char *bytes;
  size_t size;
  supine_platform_file mapping; /**< the same bytes if they are mapped */
  char *header;                 /**< a copy, in which strings are decoded */
  supine_tensor *tensors;       /**< in the order of their data */
  void **copies;                /**< of misaligned tensors; NULL for the others */
  size_t tensor_count;
  supine_metadata *metadata;
  size_t metadata_count;
  char name[]; /**< for messages */
};

/** Return the name of an element type in the header, "F32"; `dtype` must be in range. */
const char *supine_safetensors_dtype_name(supine_dtype dtype);

/** Return the bytes of one element. */
size_t supine_safetensors_dtype_size(supine_dtype dtype);

/** Compute the bytes of a tensor; false if that overflows. */
bool supine_safetensors_tensor_size(const supine_tensor *tensor, size_t *size);

/** Parse and check the header of file->bytes, and place the tensors.
 * @retval SUPINE_ERROR_FORMAT, SUPINE_ERROR_MEMORY */
supine_status supine_safetensors_parse(supine_safetensors *file, supine_error *error);

/** Compute the text that metadata "checksum" must hold, of the same kind as `stated`: "xxh64:" and
 * 16 hexadecimal digits, also if it is NULL, or the 16 digits alone of a file of version 1. */
void supine_safetensors_checksum_text(const char *stated, const supine_tensor *tensors,
                                      size_t tensor_count, const supine_metadata *metadata,
                                      size_t metadata_count, char text[CHECKSUM_SIZE]);

#endif
