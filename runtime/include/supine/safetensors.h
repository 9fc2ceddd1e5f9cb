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
#include <stdio.h>

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
  SUPINE_I16,
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
 *     tensors    h(data, h("F32 [20000,3]", h(name, 0)))         element type and shape, thus
 * written metadata   h(value, h(key, 1))                             the key "checksum" left out
 *
 * where h(bytes, seed) is XXH64 (as in xxHash's libraries for other languages), text is UTF-8 and
 * numbers are little-endian. In Python, with `import xxhash`:
 *
 *     h = xxhash.xxh64_intdigest
 *     total = sum(h(data, h(f"{dtype} [{','.join(map(str, shape))}]", h(name, 0)))
 *                 for name, dtype, shape, data in tensors)
 *     total += sum(h(value, h(key, 1)) for key, value in metadata if key != "checksum")
 *     checksum = f"xxh64:{total % 2**64:016x}"
 *
 * Cost: one pass at about the speed of memory. Guards against accidents, not against forgery. */
SUPINE_API uint64_t supine_safetensors_checksum(const supine_tensor *tensors, size_t tensor_count,
                                                const supine_metadata *metadata,
                                                size_t metadata_count);

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

/** All metadata, in the file's order.
 * @param count  written */
SUPINE_API const supine_metadata *supine_safetensors_all_metadata(const supine_safetensors *file,
                                                                  size_t *count);

/** Checks the file's content against its metadata "checksum": "xxh64:" and 16 hexadecimal digits,
 * or the 16 digits alone of a hash of Supine's own that basis files of version 1 have.
 * @retval SUPINE_ERROR_FORMAT  no checksum, or the content differs: the file is corrupted */
SUPINE_API supine_status supine_safetensors_verify(const supine_safetensors *file,
                                                   supine_error *error);

/** Write a file to a stream, and add the metadata "checksum". Tensors are laid out by descending
 * element size, in the given order within one size, so that each begins at a multiple of its
 * element size; the header is padded with spaces to a multiple of 8. Errors of writing stay in the
 * stream: see ferror, fclose.
 * @param name  of the file, for messages
 * @retval SUPINE_ERROR_ARGUMENT  two tensors or two keys of one name, a dtype, rank or size out of
 *                                range, text that is not UTF-8, or the key "checksum", which is the
 *                                writer's */
SUPINE_API supine_status supine_safetensors_write(FILE *file, const char *name,
                                                  const supine_tensor *tensors, size_t tensor_count,
                                                  const supine_metadata *metadata,
                                                  size_t metadata_count, supine_error *error);

#ifdef __cplusplus
}
#endif
#endif
