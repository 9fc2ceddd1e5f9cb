/* SPDX-License-Identifier: MIT */
/* An open safetensors file: what it holds, and its end. */
#include <stdlib.h>
#include <string.h>

#include "runtime/safetensors/safetensors_file.h"

void supine_safetensors_close(supine_safetensors *file) {
  if (file == NULL) {
    return;
  }
  supine_platform_unmap(&file->mapping);
  for (size_t i = 0; file->copies != NULL && i < file->tensor_count; ++i) {
    free(file->copies[i]);
  }
  free(file->copies);
  free(file->tensors);
  free(file->metadata);
  free(file->entries);
  free(file->header);
  free(file->name);
  free(file);
}

const supine_tensor *supine_safetensors_find(const supine_safetensors *file, const char *name) {
  for (size_t i = 0; i < file->tensor_count; ++i) {
    if (strcmp(file->tensors[i].name, name) == 0) {
      return &file->tensors[i];
    }
  }
  return NULL;
}

const char *supine_safetensors_metadata(const supine_safetensors *file, const char *key) {
  for (size_t i = 0; i < file->metadata_count; ++i) {
    if (strcmp(file->metadata[i].key, key) == 0) {
      return file->metadata[i].value;
    }
  }
  return NULL;
}

const supine_metadata *supine_safetensors_all_metadata(const supine_safetensors *file,
                                                       size_t *count) {
  *count = file->metadata_count;
  return file->metadata;
}
