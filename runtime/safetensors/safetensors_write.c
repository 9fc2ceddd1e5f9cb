/* SPDX-License-Identifier: MIT */
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#include "base/arena.h"
#include "base/number.h"
#include "base/output.h"
#include "base/utf8.h"
#include "runtime/safetensors/safetensors_file.h"

typedef struct content {
  const supine_tensor *tensors;
  size_t tensor_count;
  const supine_metadata *metadata;
  size_t metadata_count;
  char checksum[CHECKSUM_SIZE];
} content;

static bool is_utf8(const char *text) {
  size_t left = strlen(text);
  while (left > 0) {
    const size_t length = supine_utf8_length(text, left);
    if (length == 0) {
      return false;
    }
    text += length;
    left -= length;
  }
  return true;
}

static supine_status check_tensors(const content *c, const char *path, supine_error *error) {
  size_t total = 0;
  for (size_t i = 0; i < c->tensor_count; ++i) {
    const supine_tensor *tensor = &c->tensors[i];
    size_t size = 0;
    bool bad = (int)tensor->dtype < 0 || tensor->dtype >= SUPINE_DTYPE_COUNT || tensor->rank < 1 ||
               tensor->rank > SUPINE_TENSOR_RANK_MAX ||
               !supine_safetensors_tensor_size(tensor, &size) ||
               __builtin_add_overflow(total, size, &total) || (tensor->data == NULL && size > 0) ||
               strcmp(tensor->name, "__metadata__") == 0 || !is_utf8(tensor->name);
    for (size_t j = 0; j < i; ++j) {
      bad = bad || strcmp(tensor->name, c->tensors[j].name) == 0;
    }
    if (bad) {
      return supine_error_set(
          error, SUPINE_ERROR_ARGUMENT,
          "%s: tensor '%s': dtype, rank or size is out of range, or the name is "
          "repeated, reserved or not UTF-8",
          path, tensor->name);
    }
  }
  return SUPINE_OK;
}

static supine_status check_metadata(const content *c, const char *path, supine_error *error) {
  for (size_t i = 0; i < c->metadata_count; ++i) {
    const supine_metadata *item = &c->metadata[i];
    bool bad = strcmp(item->key, "checksum") == 0 || !is_utf8(item->key) || !is_utf8(item->value);
    for (size_t j = 0; j < i; ++j) {
      bad = bad || strcmp(item->key, c->metadata[j].key) == 0;
    }
    if (bad) {
      return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                              "%s: metadata '%s': the key is repeated or reserved, or the text is "
                              "not UTF-8",
                              path, item->key);
    }
  }
  return SUPINE_OK;
}

/* Print to a file, or only count if `file` is NULL; return the number of bytes. */
static size_t SUPINE_PRINTF(2, 3) put(FILE *file, const char *format, ...) {
  va_list arguments;
  va_start(arguments, format);
  const int size = file != NULL ? supine_print_list(file, format, arguments)
                                : supine_print_text_list(NULL, 0, format, arguments);
  va_end(arguments);
  return size > 0 ? (size_t)size : 0;
}

static size_t put_string(FILE *file, const char *text) {
  size_t size = put(file, "\"");
  while (*text != '\0') {
    size_t plain = 0;
    while ((unsigned char)text[plain] >= 0x20 && text[plain] != '"' && text[plain] != '\\') {
      ++plain;
    }
    size += put(file, "%.*s", (int)plain, text);
    text += plain;
    if (*text == '"' || *text == '\\') {
      size += put(file, "\\%c", *text++);
    } else if (*text != '\0') {
      size += put(file, "\\u%04x", (unsigned)*text++);
    }
  }
  return size + put(file, "\"");
}

/* Return tensor n in the order of the file: by descending element size, and those of the same size
 * in the order given. */
static const supine_tensor *tensor_at(const content *c, size_t n) {
  for (size_t element = 8;; element /= 2) {
    for (size_t i = 0; i < c->tensor_count; ++i) {
      if (supine_safetensors_dtype_size(c->tensors[i].dtype) == element && n-- == 0) {
        return &c->tensors[i];
      }
    }
  }
}

/* Write the header to a file, or only count if `file` is NULL; return its size without padding. */
static size_t put_header(const content *c, FILE *file) {
  size_t size = put(file, "{\"__metadata__\":{");
  size_t offset = 0;
  for (size_t i = 0; i < c->metadata_count; ++i) {
    size += put_string(file, c->metadata[i].key) + put(file, ":");
    size += put_string(file, c->metadata[i].value) + put(file, ",");
  }
  size += put(file, "\"checksum\":\"%s\"}", c->checksum);
  for (size_t i = 0; i < c->tensor_count; ++i) {
    const supine_tensor *tensor = tensor_at(c, i);
    const size_t bytes = supine_safetensors_size(tensor);
    size += put(file, ",") + put_string(file, tensor->name);
    size +=
        put(file, ":{\"dtype\":\"%s\",\"shape\":[", supine_safetensors_dtype_name(tensor->dtype));
    for (size_t r = 0; r < tensor->rank; ++r) {
      size += put(file, "%s%zu", r == 0 ? "" : ",", tensor->shape[r]);
    }
    size += put(file, "],\"data_offsets\":[%zu,%zu]}", offset, offset + bytes);
    offset += bytes;
  }
  return size + put(file, "}");
}

void supine_safetensors_print(FILE *file, const supine_tensor *tensors, size_t tensor_count,
                              const supine_metadata *metadata, size_t metadata_count) {
  content c = {tensors, tensor_count, metadata, metadata_count, ""};
  (void)supine_print_text(
      c.checksum, sizeof c.checksum, CHECKSUM_FORMAT,
      supine_safetensors_checksum(tensors, tensor_count, metadata, metadata_count));
  const size_t header = put_header(&c, NULL);
  const size_t padded = (header + 7) / 8 * 8;
  const uint64_t length = padded;
  (void)fwrite(&length, sizeof length, 1, file);
  (void)put_header(&c, file);
  (void)put(file, "%*s", (int)(padded - header), "");
  for (size_t i = 0; i < tensor_count; ++i) {
    const supine_tensor *tensor = tensor_at(&c, i);
    const size_t size = supine_safetensors_size(tensor);
    if (size > 0) {
      (void)fwrite(tensor->data, 1, size, file);
    }
  }
}

supine_status supine_safetensors_write(const char *path, const supine_tensor *tensors,
                                       size_t tensor_count, const supine_metadata *metadata,
                                       size_t metadata_count, supine_error *error) {
  const content c = {tensors, tensor_count, metadata, metadata_count, ""};
  supine_output output;
  SUPINE_TRY(check_tensors(&c, path, error));
  SUPINE_TRY(check_metadata(&c, path, error));
  SUPINE_TRY(supine_output_open(path, &output, error));
  supine_safetensors_print(output.file, tensors, tensor_count, metadata, metadata_count);
  return supine_output_commit(&output, error);
}
