/* SPDX-License-Identifier: MIT */
/* The header of a safetensors file: parse, and believe nothing that is not checked. */
#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "runtime/safetensors/json.h"
#include "runtime/safetensors/safetensors_file.h"

enum { PREFIX = 8, HEADER_MAX = 1 << 24, TENSORS_MAX = 1024, METADATA_MAX = 4096 };

_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "tensors are little-endian");

#define FORMAT_ERROR(file, ...) format_error((file)->error, (file)->name, __VA_ARGS__)

static supine_status SUPINE_PRINTF(3, 4)
    format_error(supine_error *error, const char *name, const char *format, ...) {
  char detail[256];
  va_list arguments;
  va_start(arguments, format);
  (void)vsnprintf(detail, sizeof detail, format, arguments);
  va_end(arguments);
  return supine_error_set(error, SUPINE_ERROR_FORMAT, "%s: %s", name, detail);
}

static supine_status bad_json(const supine_safetensors *file, const json_cursor *cursor) {
  return FORMAT_ERROR(file, "the header is not safetensors JSON at its byte %td",
                      cursor->at - file->header);
}

/* Room for one more item in an array that doubles. */
static bool grow(void **items, size_t count, size_t item_size) {
  if (count != 0 && (count & (count - 1)) != 0) {
    return true;
  }
  void *grown = realloc(*items, (count == 0 ? 1 : 2 * count) * item_size);
  if (grown == NULL) {
    return false;
  }
  *items = grown;
  return true;
}

static supine_status no_memory(const supine_safetensors *file) {
  return supine_error_set(file->error, SUPINE_ERROR_MEMORY, "%s: out of memory", file->name);
}

static supine_status parse_metadata(supine_safetensors *file, json_cursor *cursor) {
  if (!supine_safetensors_json_take(cursor, '{')) {
    return bad_json(file, cursor);
  }
  if (supine_safetensors_json_take(cursor, '}')) {
    return SUPINE_OK;
  }
  do {
    const char *key = supine_safetensors_json_string(cursor);
    const char *value = key != NULL && supine_safetensors_json_take(cursor, ':')
                            ? supine_safetensors_json_string(cursor)
                            : NULL;
    if (value == NULL) {
      return bad_json(file, cursor);
    }
    if (supine_safetensors_metadata(file, key) != NULL) {
      return FORMAT_ERROR(file, "two metadata strings are named '%.64s'", key);
    }
    if (file->metadata_count == METADATA_MAX) {
      return FORMAT_ERROR(file, "more than %d metadata strings", METADATA_MAX);
    }
    if (!grow((void **)&file->metadata, file->metadata_count, sizeof *file->metadata)) {
      return no_memory(file);
    }
    file->metadata[file->metadata_count++] = (supine_metadata){key, value};
  } while (supine_safetensors_json_take(cursor, ','));
  return supine_safetensors_json_take(cursor, '}') ? SUPINE_OK : bad_json(file, cursor);
}

static bool parse_dtype(const char *name, supine_dtype *dtype) {
  for (int i = 0; i < (int)SUPINE_DTYPE_COUNT; ++i) {
    if (strcmp(name, supine_safetensors_dtype_name((supine_dtype)i)) == 0) {
      *dtype = (supine_dtype)i;
      return true;
    }
  }
  return false;
}

/* {"dtype": "F32", "shape": [2, 3], "data_offsets": [0, 24]}, members in any order. */
static supine_status parse_tensor(supine_safetensors *file, json_cursor *cursor,
                                  safetensors_entry *item) {
  bool has_dtype = false;
  bool has_shape = false;
  bool has_offsets = false;
  const char *name = item->tensor.name;
  if (!supine_safetensors_json_take(cursor, '{')) {
    return bad_json(file, cursor);
  }
  do {
    const char *key = supine_safetensors_json_string(cursor);
    bool good = key != NULL && supine_safetensors_json_take(cursor, ':');
    if (good && !has_dtype && strcmp(key, "dtype") == 0) {
      const char *dtype = supine_safetensors_json_string(cursor);
      good = has_dtype = dtype != NULL;
      if (good && !parse_dtype(dtype, &item->tensor.dtype)) {
        return FORMAT_ERROR(file, "tensor '%.64s': dtype '%.16s' is none of U8, I16, U32, F32, F64",
                            name, dtype);
      }
    } else if (good && !has_shape && strcmp(key, "shape") == 0) {
      good = has_shape = supine_safetensors_json_counts(cursor, item->tensor.shape,
                                                        SUPINE_TENSOR_RANK_MAX, &item->tensor.rank);
    } else if (good && !has_offsets && strcmp(key, "data_offsets") == 0) {
      size_t offsets[2] = {0, 0};
      size_t count = 0;
      good = has_offsets = supine_safetensors_json_counts(cursor, offsets, 2, &count) && count == 2;
      item->begin = offsets[0];
      item->end = offsets[1];
    } else {
      good = false;
    }
    if (!good) {
      return bad_json(file, cursor);
    }
  } while (supine_safetensors_json_take(cursor, ','));
  if (!supine_safetensors_json_take(cursor, '}')) {
    return bad_json(file, cursor);
  }
  size_t size = 0;
  if (!has_dtype || !has_shape || !has_offsets || item->tensor.rank < 1) {
    return FORMAT_ERROR(file, "tensor '%.64s' lacks a dtype, a shape of 1 to %d axes or offsets",
                        name, SUPINE_TENSOR_RANK_MAX);
  }
  if (!supine_safetensors_tensor_size(&item->tensor, &size) || item->begin > item->end ||
      item->end - item->begin != size) {
    return FORMAT_ERROR(file, "tensor '%.64s': its shape and its offsets disagree", name);
  }
  return SUPINE_OK;
}

static supine_status parse_header(supine_safetensors *file, size_t length) {
  json_cursor cursor = {file->header, file->header + length};
  bool has_metadata = false;
  if (file->header[0] != '{') {
    return FORMAT_ERROR(file, "not a safetensors file");
  }
  (void)supine_safetensors_json_take(&cursor, '{');
  if (!supine_safetensors_json_take(&cursor, '}')) {
    do {
      const char *name = supine_safetensors_json_string(&cursor);
      if (name == NULL || !supine_safetensors_json_take(&cursor, ':')) {
        return bad_json(file, &cursor);
      }
      if (strcmp(name, "__metadata__") == 0) {
        if (has_metadata) {
          return FORMAT_ERROR(file, "two __metadata__ objects");
        }
        has_metadata = true;
        const supine_status status = parse_metadata(file, &cursor);
        if (status != SUPINE_OK) {
          return status;
        }
        continue;
      }
      for (size_t i = 0; i < file->tensor_count; ++i) {
        if (strcmp(name, file->entries[i].tensor.name) == 0) {
          return FORMAT_ERROR(file, "two tensors are named '%.64s'", name);
        }
      }
      if (file->tensor_count == TENSORS_MAX) {
        return FORMAT_ERROR(file, "more than %d tensors", TENSORS_MAX);
      }
      if (!grow((void **)&file->entries, file->tensor_count, sizeof *file->entries)) {
        return no_memory(file);
      }
      safetensors_entry *item = &file->entries[file->tensor_count++];
      *item = (safetensors_entry){.tensor = {.name = name}};
      const supine_status status = parse_tensor(file, &cursor, item);
      if (status != SUPINE_OK) {
        return status;
      }
    } while (supine_safetensors_json_take(&cursor, ','));
    if (!supine_safetensors_json_take(&cursor, '}')) {
      return bad_json(file, &cursor);
    }
  }
  return supine_safetensors_json_at_end(&cursor) ? SUPINE_OK : bad_json(file, &cursor);
}

static int entry_compare(const void *left, const void *right) {
  const safetensors_entry *a = left;
  const safetensors_entry *b = right;
  if (a->begin != b->begin) {
    return a->begin < b->begin ? -1 : 1;
  }
  return a->end < b->end ? -1 : a->end > b->end;
}

/* The tensors must tile the data exactly; then each gets its address, or an aligned copy. */
static supine_status place_tensors(supine_safetensors *file, size_t data_begin) {
  const size_t data_size = file->size - data_begin;
  if (file->tensor_count > 0) {
    qsort(file->entries, file->tensor_count, sizeof *file->entries, entry_compare);
  }
  size_t at = 0;
  for (size_t i = 0; i < file->tensor_count; ++i) {
    const safetensors_entry *item = &file->entries[i];
    if (item->begin != at) {
      return FORMAT_ERROR(file, "tensor '%.64s' begins at byte %zu of the data instead of %zu",
                          item->tensor.name, item->begin, at);
    }
    at = item->end;
  }
  if (at != data_size) {
    return FORMAT_ERROR(file, "%s: the tensors need %zu bytes, the file has %zu",
                        at > data_size ? "truncated" : "trailing bytes", at, data_size);
  }
  file->tensors = calloc(file->tensor_count + 1, sizeof *file->tensors);
  file->copies = calloc(file->tensor_count + 1, sizeof *file->copies);
  if (file->tensors == NULL || file->copies == NULL) {
    return no_memory(file);
  }
  for (size_t i = 0; i < file->tensor_count; ++i) {
    const safetensors_entry *item = &file->entries[i];
    const unsigned char *data = file->bytes + data_begin + item->begin;
    file->tensors[i] = item->tensor;
    file->tensors[i].data = data;
    if ((uintptr_t)data % supine_safetensors_dtype_size(item->tensor.dtype) != 0) {
      const size_t size = item->end - item->begin;
      file->copies[i] = malloc(size + 1);
      if (file->copies[i] == NULL) {
        return no_memory(file);
      }
      memcpy(file->copies[i], data, size);
      file->tensors[i].data = file->copies[i];
    }
  }
  return SUPINE_OK;
}

supine_status supine_safetensors_parse(supine_safetensors *file) {
  if (file->size < PREFIX + 2) {
    return FORMAT_ERROR(file, file->size == 0 ? "empty file" : "too short for a safetensors file");
  }
  uint64_t length = 0;
  memcpy(&length, file->bytes, PREFIX);
  if (length > file->size - PREFIX || length > HEADER_MAX || length < 2) {
    return FORMAT_ERROR(file,
                        "not a safetensors file, or truncated: a header of %" PRIu64
                        " bytes in a file of %zu",
                        length, file->size);
  }
  file->header = malloc((size_t)length);
  if (file->header == NULL) {
    return no_memory(file);
  }
  memcpy(file->header, file->bytes + PREFIX, (size_t)length);
  const supine_status status = parse_header(file, (size_t)length);
  return status != SUPINE_OK ? status : place_tensors(file, PREFIX + (size_t)length);
}
