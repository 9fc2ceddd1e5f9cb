/* SPDX-License-Identifier: MIT */
/* Element types of safetensors files, and the checksum over tensors and metadata. */
#include <string.h>

#include "runtime/safetensors/dtype.h"
#include "runtime/safetensors/hash.h"

static const struct {
  const char *name;
  size_t size;
} dtypes[SUPINE_DTYPE_COUNT] = {
    [SUPINE_U8] = {"U8", 1},
    [SUPINE_U32] = {"U32", 4},
    [SUPINE_F32] = {"F32", 4},
    [SUPINE_F64] = {"F64", 8},
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

static uint64_t hash_text(const char *text, uint64_t seed) {
  return supine_safetensors_hash(text, strlen(text), seed);
}

uint64_t supine_safetensors_checksum(const supine_tensor *tensors, size_t tensor_count,
                                     const supine_metadata *metadata, size_t metadata_count) {
  uint64_t sum = 0;
  for (size_t i = 0; i < tensor_count; ++i) {
    const supine_tensor *tensor = &tensors[i];
    uint64_t shape[SUPINE_TENSOR_RANK_MAX] = {0};
    for (size_t r = 0; r < tensor->rank; ++r) {
      shape[r] = tensor->shape[r];
    }
    size_t size = 0;
    (void)supine_safetensors_tensor_size(tensor, &size);
    const uint64_t name =
        hash_text(supine_safetensors_dtype_name(tensor->dtype), hash_text(tensor->name, 1));
    sum += supine_safetensors_hash(
        tensor->data, size, supine_safetensors_hash(shape, tensor->rank * sizeof *shape, name));
  }
  for (size_t i = 0; i < metadata_count; ++i) {
    if (strcmp(metadata[i].key, "checksum") != 0) {
      sum += hash_text(metadata[i].value, hash_text(metadata[i].key, 2));
    }
  }
  return sum;
}
