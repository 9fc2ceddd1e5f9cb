/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Write safetensors files atomically. */
#ifndef SUPINE_PRECOMPUTE_WRITER_H
#define SUPINE_PRECOMPUTE_WRITER_H

#include <supine/safetensors.h>

/* Write a safetensors file atomically (base/output.h): a failure leaves no partial file.
 * @retval SUPINE_ERROR_WRITE, and those of supine_safetensors_write */
supine_status supine_writer_safetensors_write(const char *path, const supine_tensor *tensors,
                                              size_t tensor_count, const supine_metadata *metadata,
                                              size_t metadata_count, supine_error *error);

#endif
