/* SPDX-License-Identifier: MIT */
/** @file
 * What an open safetensors file holds, for the files of this folder. */
#ifndef SUPINE_SAFETENSORS_FILE_H
#define SUPINE_SAFETENSORS_FILE_H

#include "runtime/safetensors/dtype.h"
#include "runtime/safetensors/platform.h"

/** A tensor and where the header says that it lies. */
typedef struct safetensors_entry {
  supine_tensor tensor;
  size_t begin, end;
} safetensors_entry;

struct supine_safetensors {
  char *name;
  const unsigned char *bytes;
  size_t size;
  supine_platform_file mapping; /**< the same bytes where they are mapped */
  char *header;                 /**< a copy, in which strings are decoded */
  supine_tensor *tensors;
  void **copies; /**< of tensors that lie misaligned; NULL elsewhere */
  size_t tensor_count;
  supine_metadata *metadata;
  size_t metadata_count;
  /* While parsing: */
  safetensors_entry *entries;
  supine_error *error;
};

/** Parses and checks the header of file->bytes, and places the tensors.
 * @retval SUPINE_ERROR_FORMAT, SUPINE_ERROR_MEMORY  with file->error filled in */
supine_status supine_safetensors_parse(supine_safetensors *file);

#endif
