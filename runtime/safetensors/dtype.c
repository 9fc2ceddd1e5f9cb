/* SPDX-License-Identifier: MIT */
/* Element types of safetensors files. */
#include "runtime/safetensors/dtype.h"

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
