/* SPDX-License-Identifier: MIT */
/* Open safetensors files, and check them against their checksum. */
#include <stdio.h>
#include <string.h>

#define XXH_INLINE_ALL
#include <xxhash.h>

#include "base/arena.h"
#include "base/number.h"
#include "runtime/safetensors/safetensors_file.h"

static uint64_t hash(const void *bytes, size_t size, uint64_t seed) {
  return XXH64(bytes, size, seed);
}

static uint64_t hash_text(const char *text, uint64_t seed) {
  return hash(text, strlen(text), seed);
}

/* Hash the element type and shape as text, such as "F32 [20000,3]". */
static uint64_t hash_kind(const supine_tensor *tensor, uint64_t seed) {
  char text[32 + 21 * SUPINE_TENSOR_RANK_MAX]; /* the length of an axis has at most 20 digits */
  size_t used =
      (size_t)snprintf(text, sizeof text, "%s [", supine_safetensors_dtype_name(tensor->dtype));
  for (size_t r = 0; r < tensor->rank; ++r) {
    used += (size_t)snprintf(text + used, sizeof text - used, "%s%zu", r == 0 ? "" : ",",
                             tensor->shape[r]);
  }
  (void)snprintf(text + used, sizeof text - used, "]");
  return hash_text(text, seed);
}

uint64_t supine_safetensors_checksum(const supine_tensor *tensors, size_t tensor_count,
                                     const supine_metadata *metadata, size_t metadata_count) {
  uint64_t sum = 0;
  for (size_t i = 0; i < tensor_count; ++i) {
    sum += hash(tensors[i].data, supine_safetensors_size(&tensors[i]),
                hash_kind(&tensors[i], hash_text(tensors[i].name, 0)));
  }
  for (size_t i = 0; i < metadata_count; ++i) {
    if (strcmp(metadata[i].key, "checksum") != 0) {
      sum += hash_text(metadata[i].value, hash_text(metadata[i].key, 1));
    }
  }
  return sum;
}

supine_status supine_safetensors_open_with(const char *name, const void *bytes, size_t size,
                                           const supine_allocator *allocator,
                                           supine_safetensors **result, supine_error *error) {
  supine_safetensors made = {.bytes = bytes, .size = size, .allocator = *allocator};
  *result = NULL;
  if (bytes == NULL) {
    SUPINE_TRY(supine_safetensors_platform_map(name, &made.mapping, error));
    made.bytes = made.mapping.bytes;
    made.size = made.mapping.size;
  }
  supine_safetensors *file = supine_safetensors_allocate(&made, sizeof made + strlen(name) + 1);
  if (file == NULL) {
    supine_safetensors_platform_unmap(&made.mapping);
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "%s: out of memory", name);
  }
  *file = made;
  strcpy(file->name, name);
  const supine_status status = supine_safetensors_parse(file, error);
  if (status == SUPINE_OK) {
    *result = file;
  } else {
    supine_safetensors_close(file);
  }
  return status;
}

supine_status supine_safetensors_open_memory(const void *bytes, size_t size, const char *name,
                                             supine_safetensors **file, supine_error *error) {
  return supine_safetensors_open_with(name, bytes != NULL ? bytes : "", size,
                                      &(supine_allocator){0}, file, error);
}

supine_status supine_safetensors_open(const char *path, supine_safetensors **file,
                                      supine_error *error) {
  return supine_safetensors_open_with(path, NULL, 0, &(supine_allocator){0}, file, error);
}

void supine_safetensors_close(supine_safetensors *file) {
  if (file == NULL) {
    return;
  }
  supine_safetensors_platform_unmap(&file->mapping);
  supine_safetensors_release(file, file->copies);
  supine_safetensors_release(file, file->tensors); /* with the metadata and the header */
  supine_safetensors_release(file, file);
}

void supine_safetensors_print_checksum(const supine_safetensors *file, char text[CHECKSUM_SIZE]) {
  (void)supine_print_text(text, CHECKSUM_SIZE, CHECKSUM_FORMAT,
                          supine_safetensors_checksum(file->tensors, file->tensor_count,
                                                      file->metadata, file->metadata_count));
}

supine_status supine_safetensors_verify(const supine_safetensors *file, supine_error *error) {
  const char *stated = supine_safetensors_metadata(file, "checksum");
  if (stated == NULL) {
    return supine_error_set(
        error, SUPINE_ERROR_FORMAT,
        "%s: no checksum, so another program wrote the file: make it with Supine", file->name);
  }
  char found[CHECKSUM_SIZE];
  supine_safetensors_print_checksum(file, found);
  return strcmp(stated, found) == 0
             ? SUPINE_OK
             : supine_error_set(error, SUPINE_ERROR_FORMAT,
                                "%s: corrupted: it states checksum %.32s, but its content has %s: "
                                "copy or write it again",
                                file->name, stated, found);
}
