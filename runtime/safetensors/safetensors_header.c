/* SPDX-License-Identifier: MIT */
/* Parse the header of a safetensors file, which is strict JSON (RFC 8259), and check every number
 * in it. Look up element types. */
#include <inttypes.h>
#include <limits.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/number.h"
#include "base/utf8.h"
#include "runtime/safetensors/safetensors_file.h"

enum { PREFIX = 8, HEADER_MAX = 1 << 24, TENSORS_MAX = 1024, METADATA_MAX = 4096 };

_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "tensors are little-endian");

static const struct {
  const char *name;
  size_t size;
} dtypes[] = {
    [SUPINE_U8] = {"U8", 1},   [SUPINE_U32] = {"U32", 4},      [SUPINE_F32] = {"F32", 4},
    [SUPINE_F64] = {"F64", 8}, [SUPINE_I16] = {"I16", 2},      [SUPINE_I8] = {"I8", 1},
    [SUPINE_U16] = {"U16", 2}, [SUPINE_DTYPE_COUNT] = {"", 1}, /* bytes of a type that is not read
                                                                */
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

size_t supine_safetensors_size(const supine_tensor *tensor) {
  size_t size = 0;
  (void)supine_safetensors_tensor_size(tensor, &size);
  return size;
}

/* State of the parser of a header, whose text ends with a NUL. After a failure, take() accepts no
 * character, and further failures do not change the error. */
typedef struct parser {
  supine_safetensors *file;
  char *at, *end;
  supine_status status;
  supine_error *error;
} parser;

static void SUPINE_PRINTF(2, 3) fail(parser *p, const char *format, ...) {
  char detail[256];
  va_list arguments;
  va_start(arguments, format);
  (void)supine_print_text_list(detail, sizeof detail, format, arguments);
  va_end(arguments);
  if (p->status == SUPINE_OK) {
    p->status = supine_error_set(p->error, SUPINE_ERROR_FORMAT, "%s: %s", p->file->name, detail);
  }
}

static void fail_json(parser *p) {
  fail(p, "byte %td of the header is not valid JSON for safetensors", p->at - p->file->header);
}

/* Skip white space, and take `character` if it comes next; return whether it did. */
static bool take(parser *p, char character) {
  p->at += p->status == SUPINE_OK ? strspn(p->at, " \t\n\r") : 0;
  if (p->status == SUPINE_OK && p->at < p->end && *p->at == character) {
    ++p->at;
    return true;
  }
  return false;
}

static void expect(parser *p, char character) {
  if (!take(p, character)) {
    fail_json(p);
  }
}

static uint32_t take_hex(parser *p) {
  char digits[5] = "";
  if (strspn(p->at, "0123456789abcdefABCDEF") < 4) {
    fail_json(p);
    return 0;
  }
  memcpy(digits, p->at, 4);
  p->at += 4;
  return (uint32_t)strtoul(digits, NULL, 16);
}

static char *put_utf8(char *to, uint32_t code) {
  static const unsigned lead[] = {0, 0xC0, 0xE0, 0xF0};
  const int more = (code >= 0x80) + (code >= 0x800) + (code >= 0x10000); /* bytes after the first */
  *to++ = (char)(lead[more] | code >> 6 * more);
  for (int i = more - 1; i >= 0; --i) {
    *to++ = (char)(0x80U | (code >> 6 * i & 0x3FU));
  }
  return to;
}

/* Decode an escape (\n, \uXXXX or a surrogate pair) into `to`; return the end of the result. */
static char *take_escape(parser *p, char *to) {
  static const char names[] = "\"\\/bfnrt";
  static const char meanings[] = "\"\\/\b\f\n\r\t";
  const char name = p->at[1];
  const char *found = name == '\0' ? NULL : strchr(names, name);
  p->at += found != NULL || name == 'u' ? 2 : 0;
  if (found != NULL) {
    *to = meanings[found - names];
    return to + 1;
  }
  uint32_t code = name == 'u' ? take_hex(p) : 0;
  if (code >= 0xD800 && code < 0xDC00 && strncmp(p->at, "\\u", 2) == 0) {
    p->at += 2;
    const uint32_t low = take_hex(p);
    code = low >= 0xDC00 && low < 0xE000 ? 0x10000 + ((code - 0xD800) << 10) + (low - 0xDC00) : 0;
  }
  if (code == 0 || (code >= 0xD800 && code < 0xE000)) {
    fail_json(p);
    return to;
  }
  return put_utf8(to, code);
}

/* Decode a string in place, to UTF-8 that ends with a NUL; return "" after a failure. */
static const char *take_string(parser *p) {
  expect(p, '"');
  char *const begin = p->at;
  /* `to` never overtakes p->at, because an escape is longer than its decoded text */
  char *to = begin;
  while (p->status == SUPINE_OK && *p->at != '"') {
    const size_t length = supine_utf8_length(p->at, (size_t)(p->end - p->at));
    if (*p->at == '\\') {
      to = take_escape(p, to);
    } else if (length == 0 || (unsigned char)*p->at < 0x20) {
      fail_json(p);
    } else {
      memmove(to, p->at, length);
      to += length;
      p->at += length;
    }
  }
  if (p->status != SUPINE_OK) {
    return "";
  }
  ++p->at;
  *to = '\0';
  return begin;
}

/* Take an array of at most `capacity` integers without sign, fraction, exponent or leading zeros.
 * Return the number of integers. Refuse ULLONG_MAX, the result of strtoull after an overflow. */
static size_t take_counts(parser *p, size_t *values, size_t capacity) {
  size_t count = 0;
  expect(p, '[');
  if (take(p, ']')) {
    return 0;
  }
  do {
    p->at += strspn(p->at, " \t\n\r");
    const size_t digits = strspn(p->at, "0123456789");
    const unsigned long long value = strtoull(p->at, NULL, 10);
    if (count == capacity || digits == 0 || (digits > 1 && *p->at == '0') || value > SIZE_MAX ||
        value == ULLONG_MAX) {
      fail_json(p);
      return 0;
    }
    p->at += digits;
    values[count++] = (size_t)value;
  } while (take(p, ','));
  expect(p, ']');
  return count;
}

static void parse_metadata(parser *p) {
  supine_safetensors *file = p->file;
  expect(p, '{');
  if (take(p, '}')) {
    return;
  }
  do {
    const char *key = take_string(p);
    expect(p, ':');
    const char *value = take_string(p);
    if (supine_safetensors_metadata(file, key) != NULL) {
      fail(p, "two metadata strings are named '%.64s'", key);
    } else if (file->metadata_count == METADATA_MAX) {
      fail(p, "more than %d metadata strings", METADATA_MAX);
    } else if (p->status == SUPINE_OK) {
      file->metadata[file->metadata_count++] = (supine_metadata){key, value};
    }
  } while (take(p, ','));
  expect(p, '}');
}

/* Take the name of a type. Return SUPINE_DTYPE_COUNT for a type that is not read. */
static supine_dtype take_dtype(parser *p) {
  const char *name = take_string(p);
  int dtype = 0;
  while (dtype < SUPINE_DTYPE_COUNT &&
         strcmp(name, supine_safetensors_dtype_name((supine_dtype)dtype)) != 0) {
    ++dtype;
  }
  return (supine_dtype)dtype;
}

/* Parse a tensor such as {"dtype": "F32", "shape": [2, 3], "data_offsets": [0, 24]}, with members
 * in any order. Until place_tensors() is called, supine_tensor.data holds the first offset. A
 * tensor of a type that is not read has the shape [bytes], until drop_unread() removes it. */
static void parse_tensor(parser *p, const char *name) {
  static const char *const members[] = {"dtype", "shape", "data_offsets"};
  supine_safetensors *file = p->file;
  supine_tensor tensor = {.name = name};
  size_t offsets[2] = {0, 0};
  size_t size = 0;
  bool seen[3] = {false};
  expect(p, '{');
  do {
    const char *key = take_string(p);
    size_t member = 0;
    while (member < 3 && strcmp(key, members[member]) != 0) {
      ++member;
    }
    expect(p, ':');
    if (member == 3 || seen[member]) {
      fail_json(p);
      return;
    }
    seen[member] = true;
    if (member == 0) {
      tensor.dtype = take_dtype(p);
    } else if (member == 1) {
      tensor.rank = take_counts(p, tensor.shape, SUPINE_TENSOR_RANK_MAX);
    } else if (take_counts(p, offsets, 2) != 2) {
      fail_json(p);
    }
  } while (take(p, ','));
  expect(p, '}');
  if (p->status != SUPINE_OK) {
    return;
  }
  if (tensor.dtype == SUPINE_DTYPE_COUNT && tensor.rank > 0 && offsets[0] <= offsets[1]) {
    tensor.rank = 1;
    tensor.shape[0] = offsets[1] - offsets[0];
  }
  if (!seen[0] || !seen[1] || !seen[2] || tensor.rank < 1) {
    fail(p, "tensor '%.64s' lacks a dtype, a shape of 1 to %d axes or offsets", name,
         SUPINE_TENSOR_RANK_MAX);
  } else if (!supine_safetensors_tensor_size(&tensor, &size) || offsets[0] > offsets[1] ||
             offsets[1] - offsets[0] != size) {
    fail(p, "tensor '%.64s': its shape and its offsets disagree", name);
  } else if (supine_safetensors_find(file, name) != NULL) {
    fail(p, "two tensors are named '%.64s'", name);
  } else if (file->tensor_count == TENSORS_MAX) {
    fail(p, "more than %d tensors", TENSORS_MAX);
  } else {
    tensor.data = (const void *)(uintptr_t)offsets[0];
    file->tensors[file->tensor_count++] = tensor;
  }
}

static void parse_header(parser *p) {
  bool has_metadata = false;
  expect(p, '{');
  if (!take(p, '}')) {
    do {
      const char *name = take_string(p);
      expect(p, ':');
      if (strcmp(name, "__metadata__") != 0) {
        parse_tensor(p, name);
      } else if (has_metadata) {
        fail(p, "two __metadata__ objects");
      } else {
        has_metadata = true;
        parse_metadata(p);
      }
    } while (take(p, ','));
    expect(p, '}');
  }
  if (take(p, '\0') || p->at != p->end) { /* only white space may follow the header */
    fail_json(p);
  }
}

static int compare_places(const void *left, const void *right) {
  const supine_tensor *a = left;
  const supine_tensor *b = right;
  const uintptr_t places[2][2] = {{(uintptr_t)a->data, supine_safetensors_size(a)},
                                  {(uintptr_t)b->data, supine_safetensors_size(b)}};
  const int key = places[0][0] == places[1][0];
  return (places[0][key] > places[1][key]) - (places[0][key] < places[1][key]);
}

static bool is_aligned(const supine_tensor *tensor) {
  return (uintptr_t)tensor->data % supine_safetensors_dtype_size(tensor->dtype) == 0;
}

/* Return the size of a tensor in bytes, rounded up to a multiple of 8. */
static size_t padded_size(const supine_tensor *tensor) {
  return (supine_safetensors_size(tensor) + 7) / 8 * 8;
}

/* Check that the tensors fill the data of the file without gaps or overlaps. Point each tensor to
 * its data or to an aligned copy of its data. */
static supine_status place_tensors(parser *p, size_t data_begin) {
  supine_safetensors *file = p->file;
  const size_t data_size = file->size - data_begin;
  size_t at = 0;
  qsort(file->tensors, file->tensor_count, sizeof *file->tensors, compare_places);
  for (size_t i = 0; i < file->tensor_count; ++i) {
    const size_t begin = (size_t)(uintptr_t)file->tensors[i].data;
    if (begin != at) {
      fail(p, "tensor '%.64s' begins at byte %zu of the data instead of %zu", file->tensors[i].name,
           begin, at);
      return p->status;
    }
    at += supine_safetensors_size(&file->tensors[i]);
  }
  if (at != data_size) {
    fail(p, "%s: the tensors need %zu bytes, but the file has %zu: copy or write it again",
         at > data_size ? "truncated" : "trailing bytes", at, data_size);
    return p->status;
  }
  size_t copied = 0;
  for (size_t i = 0; i < file->tensor_count; ++i) {
    supine_tensor *tensor = &file->tensors[i];
    tensor->data = file->bytes + data_begin + (uintptr_t)tensor->data;
    copied += is_aligned(tensor) ? 0 : padded_size(tensor);
  }
  if (copied == 0) {
    return SUPINE_OK;
  }
  file->copies = supine_safetensors_allocate(file, copied);
  if (file->copies == NULL) {
    return supine_error_set(p->error, SUPINE_ERROR_MEMORY, "%s: out of memory", file->name);
  }
  unsigned char *copy = file->copies;
  for (size_t i = 0; i < file->tensor_count; ++i) {
    supine_tensor *tensor = &file->tensors[i];
    if (!is_aligned(tensor)) {
      tensor->data = memcpy(copy, tensor->data, supine_safetensors_size(tensor));
      copy += padded_size(tensor);
    }
  }
  return SUPINE_OK;
}

/* Remove the tensors of types that are not read, such as I64 or BF16. */
static void drop_unread(supine_safetensors *file) {
  size_t kept = 0;
  for (size_t i = 0; i < file->tensor_count; ++i) {
    if (file->tensors[i].dtype != SUPINE_DTYPE_COUNT) {
      file->tensors[kept++] = file->tensors[i];
    }
  }
  file->tensor_count = kept;
}

supine_status supine_safetensors_parse(supine_safetensors *file, supine_error *error) {
  parser p = {.file = file, .error = error};
  uint64_t length = 0;
  if (file->size < PREFIX + 2) {
    fail(&p, file->size == 0 ? "empty file" : "too short for a safetensors file");
    return p.status;
  }
  memcpy(&length, file->bytes, PREFIX);
  if (length > file->size - PREFIX || length > HEADER_MAX || length < 2) {
    fail(&p,
         "not a safetensors file, or truncated: a header of %" PRIu64
         " bytes in a file of %zu bytes",
         length, file->size);
    return p.status;
  }
  if (file->bytes[PREFIX] != '{') {
    fail(&p, "not a safetensors file");
    return p.status;
  }
  size_t members = 1; /* upper bound on the number of members of all JSON objects */
  for (size_t i = 0; i < length; ++i) {
    members += file->bytes[PREFIX + i] == ':';
  }
  const size_t tensors = members < TENSORS_MAX ? members : TENSORS_MAX;
  const size_t strings = members < METADATA_MAX ? members : METADATA_MAX;
  file->tensors = supine_safetensors_allocate(
      file, tensors * sizeof *file->tensors + strings * sizeof *file->metadata + length + 1);
  if (file->tensors == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "%s: out of memory", file->name);
  }
  file->metadata = (supine_metadata *)(file->tensors + tensors);
  file->header = (char *)(file->metadata + strings);
  memcpy(file->header, file->bytes + PREFIX, (size_t)length);
  file->header[length] = '\0';
  p.at = file->header;
  p.end = file->header + length;
  parse_header(&p);
  if (p.status == SUPINE_OK) {
    p.status = place_tensors(&p, PREFIX + (size_t)length);
  }
  drop_unread(file);
  return p.status;
}

const supine_tensor *supine_safetensors_find(const supine_safetensors *file, const char *name) {
  for (size_t i = 0; i < file->tensor_count; ++i) {
    if (strcmp(file->tensors[i].name, name) == 0) {
      return &file->tensors[i];
    }
  }
  return NULL;
}

const char *supine_safetensors_metadata(const supine_safetensors *file, const char *key) {
  for (size_t i = 0; i < file->metadata_count; ++i) {
    if (strcmp(file->metadata[i].key, key) == 0) {
      return file->metadata[i].value;
    }
  }
  return NULL;
}

const supine_metadata *supine_safetensors_all_metadata(const supine_safetensors *file,
                                                       size_t *count) {
  *count = file->metadata_count;
  return file->metadata;
}
