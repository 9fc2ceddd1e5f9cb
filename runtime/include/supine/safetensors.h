/* SPDX-License-Identifier: MIT */
/** @file
 * Safetensors files: named tensors of raw little-endian numbers behind a JSON header.
 *
 *     8 bytes   length of the header, unsigned little-endian
 *     header    JSON: name -> {dtype, shape, data_offsets [begin, end)}, __metadata__ -> strings
 *     data      the tensors, one after the other without gaps
 *
 * Files that Supine writes have the metadata "checksum", which does not depend on the layout of the
 * file. It detects accidents, not forgery. It is the sum, modulo 2^64, over
 *
 *     tensors   h(data, h("F32 [20000,3]", h(name, 0)))    with the element type and shape as text
 *     metadata  h(value, h(key, 1))                        without the key "checksum"
 *
 * where h(bytes, seed) is XXH64, text is UTF-8 and numbers are little-endian. In Python, with
 * `import xxhash`:
 *
 *     h = xxhash.xxh64_intdigest
 *     total = sum(h(data, h(f"{dtype} [{','.join(map(str, shape))}]", h(name, 0)))
 *                 for name, dtype, shape, data in tensors)
 *     total += sum(h(value, h(key, 1)) for key, value in metadata if key != "checksum")
 *     checksum = f"xxh64:{total % 2**64:016x}" */
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

/** Largest number of axes of a tensor. */
enum { SUPINE_TENSOR_RANK_MAX = 4 };

/** One tensor, row-major. A tensor that is written belongs to the caller; one that is read points
 * into the memory of the file, with `data` aligned to the element size. */
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

/** An open file. */
typedef struct supine_safetensors supine_safetensors;

/** Map a file and check all of it but its checksum (supine_safetensors_verify): length of the
 * header, JSON, element types, shapes, sizes that overflow, offsets that overlap, leave gaps or
 * pass the end, trailing bytes, repeated names. The file must not change while it is open.
 * @param file  written; NULL on failure
 * @retval SUPINE_ERROR_READ, SUPINE_ERROR_FORMAT, SUPINE_ERROR_MEMORY */
SUPINE_API supine_status supine_safetensors_open(const char *path, supine_safetensors **file,
                                                 supine_error *error);

/** Open a file in memory; the caller keeps the bytes until it is closed. They need no alignment, as
 * misaligned tensors are copied.
 * @param name  name of the file, for messages */
SUPINE_API supine_status supine_safetensors_open_memory(const void *bytes, size_t size,
                                                        const char *name, supine_safetensors **file,
                                                        supine_error *error);
/** Close a file; NULL is legal. */
SUPINE_API void supine_safetensors_close(supine_safetensors *file);

/** Return the tensor of a name, or NULL. */
SUPINE_API const supine_tensor *supine_safetensors_find(const supine_safetensors *file,
                                                        const char *name);

/** Return the metadata string of a key, or NULL. */
SUPINE_API const char *supine_safetensors_metadata(const supine_safetensors *file, const char *key);

/** Return all metadata, in the order of the file.
 * @param count  number of strings, written */
SUPINE_API const supine_metadata *supine_safetensors_all_metadata(const supine_safetensors *file,
                                                                  size_t *count);

/** Check the content against the metadata "checksum". Cost: one pass at about the speed of memory.
 * @retval SUPINE_ERROR_FORMAT  the file states no checksum, or it is corrupted and has another */
SUPINE_API supine_status supine_safetensors_verify(const supine_safetensors *file,
                                                   supine_error *error);

/** Write a file to a stream, with the metadata "checksum" added. Tensors are laid out by descending
 * element size, in the given order within one size, so that each begins at a multiple of its
 * element size; the header is padded with spaces to a multiple of 8. The caller checks the stream
 * for errors (ferror, fclose).
 * @param name  name of the file, for messages
 * @retval SUPINE_ERROR_ARGUMENT  two tensors or two keys have the same name, a dtype, rank or size
 *                                is out of range, text is not UTF-8, or metadata has the key
 *                                "checksum", which this function adds */
SUPINE_API supine_status supine_safetensors_write(FILE *file, const char *name,
                                                  const supine_tensor *tensors, size_t tensor_count,
                                                  const supine_metadata *metadata,
                                                  size_t metadata_count, supine_error *error);

#ifdef __cplusplus
}
#endif
#endif
