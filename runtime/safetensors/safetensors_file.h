/* SPDX-License-Identifier: MIT */
/** @file
 * The struct of an open safetensors file, and functions that only its source files call. */
#ifndef SUPINE_SAFETENSORS_FILE_H
#define SUPINE_SAFETENSORS_FILE_H

#include <inttypes.h>
#include <stdbool.h>
#include <stdio.h>

#include <supine/safetensors.h>

#include "runtime/safetensors/platform.h"

/** Format of the metadata "checksum", and its size in bytes with the NUL. */
#define CHECKSUM_FORMAT "xxh64:%016" PRIx64
enum { CHECKSUM_SIZE = 23 };

struct supine_safetensors {
  const unsigned char *bytes;
  size_t size;
  supine_safetensors_platform_file
      mapping; /**< mapping that contains `bytes`; zero if the caller owns them */
  supine_allocator allocator;
  supine_tensor *tensors; /**< tensors, sorted by the position of their data */
  char *header;           /**< a copy of the header, in which strings are decoded */
  unsigned char *copies;  /**< copies of the tensors that are misaligned in the file; or NULL */
  size_t tensor_count;
  supine_metadata *metadata;
  size_t metadata_count;
  char name[]; /**< name of the file in messages */
};

/** Allocate memory for a file, aligned to 64 bytes and not zeroed; return NULL if there is none. */
static inline void *supine_safetensors_allocate(const supine_safetensors *file, size_t bytes) {
  const supine_allocator *with = &file->allocator;
  return with->allocate != NULL ? with->allocate(with->user, bytes)
                                : supine_safetensors_platform_allocate(bytes);
}

/** Free memory of supine_safetensors_allocate; NULL is legal. */
static inline void supine_safetensors_release(const supine_safetensors *file, void *memory) {
  const supine_allocator *with = &file->allocator;
  if (with->release == NULL) {
    supine_safetensors_platform_free(memory);
  } else if (memory != NULL) {
    with->release(with->user, memory);
  }
}

/** Open the `size` bytes of a file, or map the file `name` if `bytes` is NULL. */
supine_status supine_safetensors_open_with(const char *name, const void *bytes, size_t size,
                                           const supine_allocator *allocator,
                                           supine_safetensors **result, supine_error *error);

/** Return the name of an element type in the header, such as "F32". `dtype` must be in range. */
const char *supine_safetensors_dtype_name(supine_dtype dtype);

size_t supine_safetensors_dtype_size(supine_dtype dtype);

/** Compute the size of a tensor in bytes; return false if the size overflows. */
bool supine_safetensors_tensor_size(const supine_tensor *tensor, size_t *size);

/** Return the size of a tensor in bytes; it must not overflow. */
size_t supine_safetensors_size(const supine_tensor *tensor);

/** Parse and check the header of file->bytes, and point the tensors to their data. */
supine_status supine_safetensors_parse(supine_safetensors *file, supine_error *error);

/** Print a file like supine_safetensors_write, but without its checks. Errors are left in `file`.
 */
void supine_safetensors_print(FILE *file, const supine_tensor *tensors, size_t tensor_count,
                              const supine_metadata *metadata, size_t metadata_count);

/** Compute the checksum that supine/safetensors.h describes. */
uint64_t supine_safetensors_checksum(const supine_tensor *tensors, size_t tensor_count,
                                     const supine_metadata *metadata, size_t metadata_count);

/** Print the checksum of the content of a file, as its metadata "checksum" should state it. */
void supine_safetensors_print_checksum(const supine_safetensors *file, char text[CHECKSUM_SIZE]);

#endif
