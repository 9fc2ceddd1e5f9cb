/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Safetensors files that appear whole or not at all. */
#ifndef SUPINE_PRECOMPUTE_WRITER_H
#define SUPINE_PRECOMPUTE_WRITER_H

#include <supine/safetensors.h>

/* Write a file as supine_safetensors_write, whole or not at all (sh/base/output.h); also
 * SUPINE_ERROR_WRITE. */
supine_status supine_writer_safetensors_write(const char *path, const supine_tensor *tensors,
                                              size_t tensor_count, const supine_metadata *metadata,
                                              size_t metadata_count, supine_error *error);

#endif
