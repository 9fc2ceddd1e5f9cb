/* SPDX-License-Identifier: MIT */
/** @file
 * Safetensors files: named tensors of raw little-endian numbers behind a JSON header.
 *
 *     8 bytes   length of the header, unsigned little-endian
 *     header    JSON: name -> {dtype, shape, data_offsets [begin, end)}, __metadata__ -> strings
 *     data      the tensors, back to back, no holes
 *
 * Files that Supine writes carry a checksum of names, shapes, numbers and metadata in the metadata
 * key "checksum". */
#ifndef SUPINE_SAFETENSORS_H
#define SUPINE_SAFETENSORS_H

#include <stddef.h>
#include <stdint.h>

#include <supine/status.h>

#ifdef __cplusplus
extern "C" {
#endif

/** Element types that Supine reads and writes. */
typedef enum supine_dtype {
  SUPINE_U8 = 0,
  SUPINE_U32,
  SUPINE_F32,
  SUPINE_F64,
  SUPINE_DTYPE_COUNT
} supine_dtype;

enum { SUPINE_TENSOR_RANK_MAX = 4 };

/** One tensor, row-major. When written: owned by the caller. When read: inside the file's memory,
 * `data` aligned to its element size. */
typedef struct supine_tensor {
  const char *name;
  supine_dtype dtype;
  size_t rank; /**< 1 to SUPINE_TENSOR_RANK_MAX */
  size_t shape[SUPINE_TENSOR_RANK_MAX];
  const void *data;
} supine_tensor;

/** One string of __metadata__. */
typedef struct supine_metadata {
  const char *key;
  const char *value;
} supine_metadata;

/** A 64-bit checksum of everything but the layout: the sum, modulo 2^64, over
 *
 *     tensors    h(data, h(shape as 64-bit words, h(dtype name, h(tensor name, 1))))
 *     metadata   h(value, h(key, 2)), the key "checksum" left out
 *
 * where h(bytes, seed) is supine_safetensors_hash (runtime/hash.h) and numbers are little-endian.
 * Cost: one pass at about the speed of memory. */
SUPINE_API uint64_t supine_safetensors_checksum(const supine_tensor *tensors, size_t tensor_count,
                                                const supine_metadata *metadata,
                                                size_t metadata_count);

/** Writes a file, whole or not at all (see output.h), and adds metadata "checksum": the 16
 * hexadecimal digits of supine_safetensors_checksum. Tensors are laid out by descending element
 * size, in the given order within one size, so that each begins at a multiple of its element size;
 * the header is padded with spaces to a multiple of 8. Bytes of a name, key or value that are not
 * UTF-8 are written as '?'. Not part of the run-time library.
 * @retval SUPINE_ERROR_ARGUMENT  two tensors or two keys of one name, a dtype, rank or size out of
 *                                range, or the key "checksum", which is the writer's
 * @retval SUPINE_ERROR_WRITE, SUPINE_ERROR_MEMORY */
supine_status supine_writer_safetensors_write(const char *path, const supine_tensor *tensors,
                                              size_t tensor_count, const supine_metadata *metadata,
                                              size_t metadata_count, supine_error *error);

/** An opened file. */
typedef struct supine_safetensors supine_safetensors;

/** Maps and validates a file (not its checksum: see supine_safetensors_verify): header length,
 * JSON, dtypes, shapes, sizes that overflow, offsets that overlap, leave holes or pass the end,
 * trailing bytes, duplicate names. The file must not change while it is open.
 * @retval SUPINE_ERROR_READ, SUPINE_ERROR_FORMAT, SUPINE_ERROR_MEMORY */
SUPINE_API supine_status supine_safetensors_open(const char *path, supine_safetensors **file,
                                                 supine_error *error);

/** The same from memory that the caller keeps until close; `name` is for messages. Bytes need no
 * alignment: where a tensor is misaligned the content is copied. */
SUPINE_API supine_status supine_safetensors_open_memory(const void *bytes, size_t size,
                                                        const char *name, supine_safetensors **file,
                                                        supine_error *error);
SUPINE_API void supine_safetensors_close(supine_safetensors *file);

/** The tensor of that name, or NULL. */
SUPINE_API const supine_tensor *supine_safetensors_find(const supine_safetensors *file,
                                                        const char *name);

/** The metadata string of that key, or NULL. */
SUPINE_API const char *supine_safetensors_metadata(const supine_safetensors *file, const char *key);

/** Checks the file's content against its metadata "checksum".
 * @retval SUPINE_ERROR_FORMAT  no checksum, or the content differs: the file is corrupted */
SUPINE_API supine_status supine_safetensors_verify(const supine_safetensors *file,
                                                   supine_error *error);

#ifdef __cplusplus
}
#endif
#endif
