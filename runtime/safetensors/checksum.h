/* SPDX-License-Identifier: MIT */
/** @file
 * The checksum of a file as its metadata states it. */
#ifndef SUPINE_CHECKSUM_H
#define SUPINE_CHECKSUM_H

#include <supine/safetensors.h>

/** Characters of a stated checksum, with the NUL. */
enum { CHECKSUM_SIZE = 23 };

/** The text that metadata "checksum" must be, of the kind that `stated` is: "xxh64:" and 16
 * hexadecimal digits, as where it is NULL, or the 16 digits alone of a file of version 1 (hash.h).
 */
void supine_safetensors_checksum_text(const char *stated, const supine_tensor *tensors,
                                      size_t tensor_count, const supine_metadata *metadata,
                                      size_t metadata_count, char text[CHECKSUM_SIZE]);

#endif
