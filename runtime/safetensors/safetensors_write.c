/* SPDX-License-Identifier: MIT */
/* Writing safetensors files. */
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "runtime/safetensors/checksum.h"
#include "runtime/safetensors/dtype.h"
#include "runtime/safetensors/json.h"
#include <supine/safetensors.h>

/* The header while it grows, and copies of every string in clean UTF-8. */
typedef struct writer {
  char *header;
  size_t size, capacity;
  bool failed; /* out of memory */
  supine_tensor *tensors;
  supine_metadata *metadata;
  char *strings; /* what tensors and metadata point into */
} writer;

static void put_bytes(writer *w, const char *bytes, size_t size) {
  if (w->failed) {
    return;
  }
  if (size > w->capacity - w->size) {
    const size_t capacity = 2 * (w->size + size) + 256;
    char *grown = realloc(w->header, capacity);
    if (grown == NULL) {
      w->failed = true;
      return;
    }
    w->header = grown;
    w->capacity = capacity;
  }
  memcpy(w->header + w->size, bytes, size);
  w->size += size;
}

static void put_text(writer *w, const char *text) {
  put_bytes(w, text, strlen(text));
}

static void put_count(writer *w, size_t value) {
  char digits[32];
  (void)snprintf(digits, sizeof digits, "%zu", value);
  put_text(w, digits);
}

static void put_string(writer *w, const char *text) {
  put_text(w, "\"");
  for (const char *c = text; *c != '\0'; ++c) {
    char escaped[8] = {*c, '\0'};
    if (*c == '"' || *c == '\\') {
      (void)snprintf(escaped, sizeof escaped, "\\%c", *c);
    } else if ((unsigned char)*c < 0x20) {
      (void)snprintf(escaped, sizeof escaped, "\\u%04x", (unsigned)(unsigned char)*c);
    }
    put_text(w, escaped);
  }
  put_text(w, "\"");
}

/* Copies text with '?' for each byte that is not UTF-8; returns the copy. */
static const char *clean_copy(char **to, const char *text) {
  char *const begin = *to;
  size_t left = strlen(text);
  while (left > 0) {
    const size_t length = supine_safetensors_utf8_length(text, left);
    const size_t step = length == 0 ? 1 : length;
    if (length == 0) {
      **to = '?';
    } else {
      memcpy(*to, text, length);
    }
    *to += step;
    text += step;
    left -= step;
  }
  *(*to)++ = '\0';
  return begin;
}

static supine_status check_tensors(const supine_tensor *tensors, size_t count, const char *path,
                                   supine_error *error) {
  size_t total = 0;
  for (size_t i = 0; i < count; ++i) {
    const supine_tensor *tensor = &tensors[i];
    size_t size = 0;
    if ((int)tensor->dtype < 0 || tensor->dtype >= SUPINE_DTYPE_COUNT || tensor->rank < 1 ||
        tensor->rank > SUPINE_TENSOR_RANK_MAX || !supine_safetensors_tensor_size(tensor, &size) ||
        __builtin_add_overflow(total, size, &total) || (tensor->data == NULL && size > 0)) {
      return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                              "%s: tensor '%s': dtype, rank or size out of range", path,
                              tensor->name);
    }
  }
  return SUPINE_OK;
}

/* Names are compared as they will stand in the file. */
static supine_status check_names(const writer *w, size_t tensor_count, size_t metadata_count,
                                 const char *path, supine_error *error) {
  const char *twice = NULL;
  for (size_t i = 0; i < tensor_count; ++i) {
    bool bad = strcmp(w->tensors[i].name, "__metadata__") == 0;
    for (size_t j = 0; j < i; ++j) {
      bad = bad || strcmp(w->tensors[i].name, w->tensors[j].name) == 0;
    }
    twice = bad ? w->tensors[i].name : twice;
  }
  for (size_t i = 0; i < metadata_count; ++i) {
    bool bad = strcmp(w->metadata[i].key, "checksum") == 0;
    for (size_t j = 0; j < i; ++j) {
      bad = bad || strcmp(w->metadata[i].key, w->metadata[j].key) == 0;
    }
    twice = bad ? w->metadata[i].key : twice;
  }
  return twice == NULL
             ? SUPINE_OK
             : supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                                "%s: the name '%s' is given twice or reserved", path, twice);
}

static bool writer_open(writer *w, const supine_tensor *tensors, size_t tensor_count,
                        const supine_metadata *metadata, size_t metadata_count) {
  size_t text = 1;
  for (size_t i = 0; i < tensor_count; ++i) {
    text += strlen(tensors[i].name) + 1;
  }
  for (size_t i = 0; i < metadata_count; ++i) {
    text += strlen(metadata[i].key) + strlen(metadata[i].value) + 2;
  }
  w->tensors = calloc(tensor_count + 1, sizeof *w->tensors);
  w->metadata = calloc(metadata_count + 1, sizeof *w->metadata);
  w->strings = malloc(text);
  if (w->tensors == NULL || w->metadata == NULL || w->strings == NULL) {
    return false;
  }
  char *to = w->strings;
  size_t placed = 0;
  for (size_t size = 8; size >= 1; size /= 2) { /* descending element size keeps all aligned */
    for (size_t i = 0; i < tensor_count; ++i) {
      if (supine_safetensors_dtype_size(tensors[i].dtype) == size) {
        w->tensors[placed] = tensors[i];
        w->tensors[placed++].name = clean_copy(&to, tensors[i].name);
      }
    }
  }
  for (size_t i = 0; i < metadata_count; ++i) {
    w->metadata[i].key = clean_copy(&to, metadata[i].key);
    w->metadata[i].value = clean_copy(&to, metadata[i].value);
  }
  return true;
}

static void put_header(writer *w, size_t tensor_count, size_t metadata_count) {
  char checksum[CHECKSUM_SIZE];
  supine_safetensors_checksum_text(NULL, w->tensors, tensor_count, w->metadata, metadata_count,
                                   checksum);
  put_text(w, "{\"__metadata__\":{");
  for (size_t i = 0; i < metadata_count; ++i) {
    put_string(w, w->metadata[i].key);
    put_text(w, ":");
    put_string(w, w->metadata[i].value);
    put_text(w, ",");
  }
  put_text(w, "\"checksum\":");
  put_string(w, checksum);
  put_text(w, "}");
  size_t offset = 0;
  for (size_t i = 0; i < tensor_count; ++i) {
    const supine_tensor *tensor = &w->tensors[i];
    size_t size = 0;
    (void)supine_safetensors_tensor_size(tensor, &size);
    put_text(w, ",");
    put_string(w, tensor->name);
    put_text(w, ":{\"dtype\":");
    put_string(w, supine_safetensors_dtype_name(tensor->dtype));
    put_text(w, ",\"shape\":[");
    for (size_t r = 0; r < tensor->rank; ++r) {
      put_text(w, r == 0 ? "" : ",");
      put_count(w, tensor->shape[r]);
    }
    put_text(w, "],\"data_offsets\":[");
    put_count(w, offset);
    offset += size;
    put_text(w, ",");
    put_count(w, offset);
    put_text(w, "]}");
  }
  put_text(w, "}");
  while (!w->failed && w->size % 8 != 0) {
    put_text(w, " ");
  }
}

supine_status supine_safetensors_write(FILE *file, const char *name, const supine_tensor *tensors,
                                       size_t tensor_count, const supine_metadata *metadata,
                                       size_t metadata_count, supine_error *error) {
  writer w = {0};
  supine_status status = check_tensors(tensors, tensor_count, name, error);
  if (status != SUPINE_OK) {
    return status;
  }
  if (!writer_open(&w, tensors, tensor_count, metadata, metadata_count)) {
    w.failed = true;
    goto cleanup;
  }
  status = check_names(&w, tensor_count, metadata_count, name, error);
  if (status != SUPINE_OK) {
    goto cleanup;
  }
  put_header(&w, tensor_count, metadata_count);
  if (w.failed) {
    goto cleanup;
  }
  const uint64_t length = w.size;
  (void)fwrite(&length, sizeof length, 1, file);
  (void)fwrite(w.header, 1, w.size, file);
  for (size_t i = 0; i < tensor_count; ++i) {
    size_t size = 0;
    (void)supine_safetensors_tensor_size(&w.tensors[i], &size);
    if (size > 0) {
      (void)fwrite(w.tensors[i].data, 1, size, file);
    }
  }

cleanup:
  if (w.failed) {
    status = supine_error_set(error, SUPINE_ERROR_MEMORY, "%s: out of memory", name);
  }
  free(w.header);
  free(w.tensors);
  free(w.metadata);
  free(w.strings);
  return status;
}
