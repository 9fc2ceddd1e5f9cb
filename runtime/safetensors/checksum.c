/* SPDX-License-Identifier: MIT */
/* The checksum over tensors and metadata, and the one that files of version 1 have. */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#define XXH_INLINE_ALL
#include <xxhash.h>

#include "runtime/safetensors/checksum.h"
#include "runtime/safetensors/dtype.h"
#include "runtime/safetensors/hash.h"

typedef uint64_t hash_function(const void *bytes, size_t size, uint64_t seed);

static uint64_t xxh64(const void *bytes, size_t size, uint64_t seed) {
  return XXH64(bytes, size, seed);
}

static uint64_t hash_text(hash_function *hash, const char *text, uint64_t seed) {
  return hash(text, strlen(text), seed);
}

/* "F32 [20000,3]" */
static uint64_t hash_kind(const supine_tensor *tensor, uint64_t seed) {
  char text[32 + 21 * SUPINE_TENSOR_RANK_MAX]; /* the longest count has 20 digits */
  size_t used =
      (size_t)snprintf(text, sizeof text, "%s [", supine_safetensors_dtype_name(tensor->dtype));
  for (size_t r = 0; r < tensor->rank; ++r) {
    used += (size_t)snprintf(text + used, sizeof text - used, "%s%zu", r == 0 ? "" : ",",
                             tensor->shape[r]);
  }
  (void)snprintf(text + used, sizeof text - used, "]");
  return hash_text(xxh64, text, seed);
}

/* Of version 1: shapes as 64-bit words. */
static uint64_t hash_kind_1(const supine_tensor *tensor, uint64_t seed) {
  uint64_t shape[SUPINE_TENSOR_RANK_MAX] = {0};
  for (size_t r = 0; r < tensor->rank; ++r) {
    shape[r] = tensor->shape[r];
  }
  const uint64_t name =
      hash_text(supine_safetensors_hash, supine_safetensors_dtype_name(tensor->dtype), seed);
  return supine_safetensors_hash(shape, tensor->rank * sizeof *shape, name);
}

typedef struct kind {
  hash_function *hash;
  uint64_t (*hash_kind)(const supine_tensor *tensor, uint64_t seed);
  uint64_t tensor_seed, metadata_seed;
} kind;

static uint64_t checksum(const kind *k, const supine_tensor *tensors, size_t tensor_count,
                         const supine_metadata *metadata, size_t metadata_count) {
  uint64_t sum = 0;
  for (size_t i = 0; i < tensor_count; ++i) {
    size_t size = 0;
    (void)supine_safetensors_tensor_size(&tensors[i], &size);
    sum += k->hash(tensors[i].data, size,
                   k->hash_kind(&tensors[i], hash_text(k->hash, tensors[i].name, k->tensor_seed)));
  }
  for (size_t i = 0; i < metadata_count; ++i) {
    if (strcmp(metadata[i].key, "checksum") != 0) {
      sum += hash_text(k->hash, metadata[i].value,
                       hash_text(k->hash, metadata[i].key, k->metadata_seed));
    }
  }
  return sum;
}

uint64_t supine_safetensors_checksum(const supine_tensor *tensors, size_t tensor_count,
                                     const supine_metadata *metadata, size_t metadata_count) {
  static const kind now = {xxh64, hash_kind, 0, 1};
  return checksum(&now, tensors, tensor_count, metadata, metadata_count);
}

void supine_safetensors_checksum_text(const char *stated, const supine_tensor *tensors,
                                      size_t tensor_count, const supine_metadata *metadata,
                                      size_t metadata_count, char text[CHECKSUM_SIZE]) {
  static const kind version_1 = {supine_safetensors_hash, hash_kind_1, 1, 2};
  if (stated == NULL || strncmp(stated, "xxh64:", 6) == 0) {
    (void)snprintf(text, CHECKSUM_SIZE, "xxh64:%016" PRIx64,
                   supine_safetensors_checksum(tensors, tensor_count, metadata, metadata_count));
  } else {
    (void)snprintf(text, CHECKSUM_SIZE, "%016" PRIx64,
                   checksum(&version_1, tensors, tensor_count, metadata, metadata_count));
  }
}
