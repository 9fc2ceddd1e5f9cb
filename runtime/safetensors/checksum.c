/* SPDX-License-Identifier: MIT */
/* Look up element types, and compute the checksum over tensors and metadata. */
#include <stdio.h>
#include <string.h>

#define XXH_INLINE_ALL
#include <xxhash.h>

#include "runtime/safetensors/safetensors_file.h"

static const struct {
  const char *name;
  size_t size;
} dtypes[SUPINE_DTYPE_COUNT] = {
    [SUPINE_U8] = {"U8", 1},   [SUPINE_U32] = {"U32", 4}, [SUPINE_F32] = {"F32", 4},
    [SUPINE_F64] = {"F64", 8}, [SUPINE_I16] = {"I16", 2},
};

const char *supine_safetensors_dtype_name(supine_dtype dtype) {
  return dtypes[dtype].name;
}

size_t supine_safetensors_dtype_size(supine_dtype dtype) {
  return dtypes[dtype].size;
}

bool supine_safetensors_tensor_size(const supine_tensor *tensor, size_t *size) {
  *size = supine_safetensors_dtype_size(tensor->dtype);
  for (size_t i = 0; i < tensor->rank; ++i) {
    if (__builtin_mul_overflow(*size, tensor->shape[i], size)) {
      return false;
    }
  }
  return true;
}

static uint64_t hash(const void *bytes, size_t size, uint64_t seed) {
  return XXH64(bytes, size, seed);
}

static uint64_t hash_text(const char *text, uint64_t seed) {
  return hash(text, strlen(text), seed);
}

/* Hash the element type and shape as text, "F32 [20000,3]". */
static uint64_t hash_kind(const supine_tensor *tensor, uint64_t seed) {
  char text[32 + 21 * SUPINE_TENSOR_RANK_MAX]; /* the longest count has 20 digits */
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
    size_t size = 0;
    (void)supine_safetensors_tensor_size(&tensors[i], &size);
    sum += hash(tensors[i].data, size, hash_kind(&tensors[i], hash_text(tensors[i].name, 0)));
  }
  for (size_t i = 0; i < metadata_count; ++i) {
    if (strcmp(metadata[i].key, "checksum") != 0) {
      sum += hash_text(metadata[i].value, hash_text(metadata[i].key, 1));
    }
  }
  return sum;
}
