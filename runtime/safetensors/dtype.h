/* SPDX-License-Identifier: MIT */
/** @file
 * Element types of safetensors files: names and sizes. */
#ifndef SUPINE_DTYPE_H
#define SUPINE_DTYPE_H

#include <stdbool.h>

#include <supine/safetensors.h>

/** The name in the header, "F32"; `dtype` must be in range. */
const char *supine_safetensors_dtype_name(supine_dtype dtype);

/** Bytes of one element. */
size_t supine_safetensors_dtype_size(supine_dtype dtype);

/** Bytes of a tensor; false when that overflows. */
bool supine_safetensors_tensor_size(const supine_tensor *tensor, size_t *size);

#endif
