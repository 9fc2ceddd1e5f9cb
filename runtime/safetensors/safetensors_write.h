/* SPDX-License-Identifier: MIT */
/** @file
 * Writing safetensors files. */
#ifndef SUPINE_SAFETENSORS_WRITE_H
#define SUPINE_SAFETENSORS_WRITE_H

#include <supine/safetensors.h>

/** Writes a file, whole or not at all (see sh/base/output.h), and adds metadata "checksum":
 * "xxh64:" and the 16 hexadecimal digits of supine_safetensors_checksum. Tensors are laid out by
 * descending element size, in the given order within one size, so that each begins at a multiple of
 * its element size; the header is padded with spaces to a multiple of 8. Bytes of a name, key or
 * value that are not UTF-8 are written as '?'.
 * @retval SUPINE_ERROR_ARGUMENT  two tensors or two keys of one name, a dtype, rank or size out of
 *                                range, or the key "checksum", which is the writer's
 * @retval SUPINE_ERROR_WRITE, SUPINE_ERROR_MEMORY */
supine_status supine_writer_safetensors_write(const char *path, const supine_tensor *tensors,
                                              size_t tensor_count, const supine_metadata *metadata,
                                              size_t metadata_count, supine_error *error);

#endif
