/* SPDX-License-Identifier: MIT */
/** @file
 * Safetensors files: named tensors of raw little-endian numbers after a JSON header.
 *
 *     8 bytes   length of the header, unsigned little-endian
 *     header    JSON: name -> {dtype, shape, data_offsets [begin, end)}, __metadata__ -> strings
 *     data      the tensors, one after the other without gaps
 *
 * Files that Supine writes have a metadata string "checksum". It detects accidental changes, not
 * forgery, and does not depend on the layout of the file. It is the sum, modulo 2^64, of a hash for
 * each tensor and a hash for each other metadata string:
 *
 *     tensor    h(data, h("F32 [20000,3]", h(name, 0)))    with the element type and shape as text
 *     metadata  h(value, h(key, 1))
 *
 * where h(bytes, seed) is XXH64, text is UTF-8 and numbers are little-endian. In Python, with
 * `import xxhash`:
 *
 *     h = xxhash.xxh64_intdigest
 *     total = sum(h(data, h(f"{dtype} [{','.join(map(str, shape))}]", h(name, 0)))
 *                 for name, dtype, shape, data in tensors)
 *     total += sum(h(value, h(key, 1)) for key, value in metadata if key != "checksum")
 *     checksum = f"xxh64:{total % 2**64:016x}"
 *
 * Stability: stable. A change before 1.0 needs a new minor version, and CHANGELOG.md says how to
 * move over. */
#ifndef SUPINE_SAFETENSORS_H
#define SUPINE_SAFETENSORS_H

#include <stddef.h>
#include <stdint.h>

#include <supine/status.h>

#ifdef __cplusplus
extern "C" {
#endif

/** Element types that Supine reads and writes. Tensors of other types in a file are ignored. */
typedef enum supine_dtype {
  SUPINE_U8 = 0,
  SUPINE_U32,
  SUPINE_F32,
  SUPINE_F64,
  SUPINE_I16,
  SUPINE_I8,
  SUPINE_U16,
  SUPINE_DTYPE_COUNT
} supine_dtype;

enum { SUPINE_TENSOR_RANK_MAX = 4 };

/** A tensor in row-major order. If the tensor is to be written, the caller owns the data. In an
 * open file, `data` points to the bytes of the file in memory, aligned to the element size. */
typedef struct supine_tensor {
  const char *name;
  supine_dtype dtype;
  size_t rank;                          /**< number of axes */
  size_t shape[SUPINE_TENSOR_RANK_MAX]; /**< length of each axis */
  const void *data;
} supine_tensor;

/** One string of the metadata, in UTF-8. */
typedef struct supine_metadata {
  const char *key;
  const char *value;
} supine_metadata;

typedef struct supine_safetensors supine_safetensors;

/** Functions that allocate memory. A zeroed struct stands for those of the C library. */
typedef struct supine_allocator {
  /** Return memory aligned to 64 bytes, not necessarily zeroed; NULL if there is none. */
  void *(*allocate)(void *user, size_t bytes);
  void (*release)(void *user, void *memory); /**< free memory of `allocate`, never NULL */
  void *user;                                /**< first argument of both functions */
} supine_allocator;

/** Map a file, and check its header and the layout of its tensors, but not its checksum
 * (supine_safetensors_verify). The file must not change while it is open.
 * @param file  written; NULL on failure
 * @retval SUPINE_ERROR_READ    the file is missing or unreadable
 * @retval SUPINE_ERROR_FORMAT  a check failed
 * @retval SUPINE_ERROR_MEMORY  an allocation failed */
SUPINE_API supine_status supine_safetensors_open(const char *path, supine_safetensors **file,
                                                 supine_error *error);

/** Open a file in memory. The caller must not change its bytes until the file is closed. The bytes
 * need no alignment, because misaligned tensors are copied. Statuses: as supine_safetensors_open.
 * @param name  name of the file in messages */
SUPINE_API supine_status supine_safetensors_open_memory(const void *bytes, size_t size,
                                                        const char *name, supine_safetensors **file,
                                                        supine_error *error);
/** Close a file; NULL is legal. */
SUPINE_API void supine_safetensors_close(supine_safetensors *file);

/** Return the tensor with a name, or NULL if there is none. */
SUPINE_API const supine_tensor *supine_safetensors_find(const supine_safetensors *file,
                                                        const char *name);

/** Return the metadata string of a key, or NULL if there is none. */
SUPINE_API const char *supine_safetensors_metadata(const supine_safetensors *file, const char *key);

/** Return all metadata, in the order of the file.
 * @param count  written: the number of metadata strings */
SUPINE_API const supine_metadata *supine_safetensors_all_metadata(const supine_safetensors *file,
                                                                  size_t *count);

/** Compare the checksum of the content with the metadata "checksum". Cost: one pass over the file,
 * at about the speed of memory.
 * @retval SUPINE_ERROR_FORMAT  the file has no checksum, or its content has a different one */
SUPINE_API supine_status supine_safetensors_verify(const supine_safetensors *file,
                                                   supine_error *error);

/** Write a safetensors file, and add the metadata "checksum". The file gets its name when it is
 * complete: a failure leaves no partial file, and an existing file unchanged. Tensors are sorted by
 * descending element size, so that each begins at a multiple of its element size; tensors of the
 * same element size keep their order. The header is padded with spaces to a multiple of 8 bytes.
 * @param path  in UTF-8; "-" is standard output, except on Windows
 * @retval SUPINE_ERROR_ARGUMENT  two tensors or two keys have the same name, a dtype, rank or size
 *                                is out of range, text is not UTF-8, or metadata has the key
 *                                "checksum" already
 * @retval SUPINE_ERROR_WRITE     the file cannot be written; the message says why, such as a full
 *                                disk
 * @retval SUPINE_ERROR_MEMORY    an allocation failed */
SUPINE_API supine_status supine_safetensors_write(const char *path, const supine_tensor *tensors,
                                                  size_t tensor_count,
                                                  const supine_metadata *metadata,
                                                  size_t metadata_count, supine_error *error);

#ifdef __cplusplus
}
#endif
#endif
