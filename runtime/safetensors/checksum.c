/* SPDX-License-Identifier: MIT */
/* Look up element types, and compute the checksum over tensors and metadata. */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#define XXH_INLINE_ALL
#include <xxhash.h>

#include "runtime/safetensors/safetensors_file.h"

static const struct {
  const char *name;
  size_t size;
} dtypes[SUPINE_DTYPE_COUNT] = {
    [SUPINE_U8] = {"U8", 1},   [SUPINE_U32] = {"U32", 4}, [SUPINE_F32] = {"F32", 4},
    [SUPINE_F64] = {"F64", 8}, [SUPINE_I16] = {"I16", 2},
};

const char *supine_safetensors_dtype_name(supine_dtype dtype) {
  return dtypes[dtype].name;
}

size_t supine_safetensors_dtype_size(supine_dtype dtype) {
  return dtypes[dtype].size;
}

bool supine_safetensors_tensor_size(const supine_tensor *tensor, size_t *size) {
  *size = supine_safetensors_dtype_size(tensor->dtype);
  for (size_t i = 0; i < tensor->rank; ++i) {
    if (__builtin_mul_overflow(*size, tensor->shape[i], size)) {
      return false;
    }
  }
  return true;
}

enum { LANES = 8, BLOCK = LANES * 8 };

static uint64_t hash_step(uint64_t lane, uint64_t word) {
  const uint64_t mixed = lane ^ word;
  return ((mixed << 29) | (mixed >> 35)) * UINT64_C(0x9E3779B97F4A7C15);
}

static void hash_block(uint64_t lanes[LANES], const unsigned char *bytes) {
  for (size_t j = 0; j < LANES; ++j) {
    uint64_t word = 0;
    memcpy(&word, bytes + 8 * j, sizeof word);
    lanes[j] = hash_step(lanes[j], word);
  }
}

/* Compute the hash of files of version 1. Eight lanes take the little-endian 64-bit words in turn,
 * the last block padded with zeros:
 *
 *     lane = rotate_left(lane ^ word, 29) * 0x9E3779B97F4A7C15        lane j begins at seed + j
 *
 * then the size and the eight lanes, in order, pass through the same step into one word that begins
 * at the seed. */
static uint64_t hash_1(const void *bytes, size_t size, uint64_t seed) {
  const unsigned char *at = bytes;
  uint64_t lanes[LANES];
  for (size_t j = 0; j < LANES; ++j) {
    lanes[j] = seed + j;
  }
  size_t left = size;
  for (; left >= BLOCK; left -= BLOCK, at += BLOCK) {
    hash_block(lanes, at);
  }
  if (left > 0) {
    unsigned char last[BLOCK] = {0};
    memcpy(last, at, left);
    hash_block(lanes, last);
  }
  uint64_t hash = hash_step(seed, size);
  for (size_t j = 0; j < LANES; ++j) {
    hash = hash_step(hash, lanes[j]);
  }
  return hash;
}

typedef uint64_t hash_function(const void *bytes, size_t size, uint64_t seed);

static uint64_t xxh64(const void *bytes, size_t size, uint64_t seed) {
  return XXH64(bytes, size, seed);
}

static uint64_t hash_text(hash_function *hash, const char *text, uint64_t seed) {
  return hash(text, strlen(text), seed);
}

/* Hash the element type and shape as text, "F32 [20000,3]". */
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

/* Hash the element type as text and the shape as 64-bit words, as in files of version 1. */
static uint64_t hash_kind_1(const supine_tensor *tensor, uint64_t seed) {
  uint64_t shape[SUPINE_TENSOR_RANK_MAX] = {0};
  for (size_t r = 0; r < tensor->rank; ++r) {
    shape[r] = tensor->shape[r];
  }
  const uint64_t name = hash_text(hash_1, supine_safetensors_dtype_name(tensor->dtype), seed);
  return hash_1(shape, tensor->rank * sizeof *shape, name);
}

/* The hash functions and seeds of one version of the checksum. */
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
  static const kind version_1 = {hash_1, hash_kind_1, 1, 2};
  if (stated == NULL || strncmp(stated, "xxh64:", 6) == 0) {
    (void)snprintf(text, CHECKSUM_SIZE, "xxh64:%016" PRIx64,
                   supine_safetensors_checksum(tensors, tensor_count, metadata, metadata_count));
  } else {
    (void)snprintf(text, CHECKSUM_SIZE, "%016" PRIx64,
                   checksum(&version_1, tensors, tensor_count, metadata, metadata_count));
  }
}
