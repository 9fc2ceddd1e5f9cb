/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Write safetensors files atomically. */
#include "precompute/writer.h"
#include "base/output.h"

supine_status supine_writer_safetensors_write(const char *path, const supine_tensor *tensors,
                                              size_t tensor_count, const supine_metadata *metadata,
                                              size_t metadata_count, supine_error *error) {
  supine_output output;
  supine_status status = supine_output_open(path, &output, error);
  if (status != SUPINE_OK) {
    return status;
  }
  status = supine_safetensors_write(output.file, path, tensors, tensor_count, metadata,
                                    metadata_count, error);
  if (status != SUPINE_OK) {
    supine_output_abandon(&output);
    return status;
  }
  return supine_output_commit(&output, error);
}
