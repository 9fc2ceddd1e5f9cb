/* SPDX-License-Identifier: MIT */
/* Check tensors and metadata of a basis file, and refuse it. */
#include <math.h>
#include <stdarg.h>
#include <string.h>

#include "base/number.h"
#include "runtime/basis_check.h"

supine_status supine_check_refuse(const supine_check *c, const char *format, ...) {
  char detail[256];
  va_list arguments;
  va_start(arguments, format);
  (void)supine_print_text_list(detail, sizeof detail, format, arguments);
  va_end(arguments);
  const bool embedded = supine_safetensors_metadata(c->file, "content") != NULL;
  return supine_error_set(c->error, SUPINE_ERROR_FORMAT, "%s: %s: %s", c->name, detail,
                          embedded ? "embed its content again" : "make the basis again");
}

/* Return whether all numbers are finite and below 2^30 in magnitude, as all numbers of a valid file
 * are. Infinity and NaN have larger exponent bits, so that one comparison of bits suffices. */
static bool finite_floats(const float *values, size_t count) {
  size_t bad = 0;
  for (size_t i = 0; i < count; ++i) {
    uint32_t bits = 0;
    memcpy(&bits, &values[i], sizeof bits);
    bad += (bits & 0x7F800000U) >= (127U + 30U) << 23;
  }
  return bad == 0;
}

static bool finite_doubles(const double *values, size_t count) {
  size_t bad = 0;
  for (size_t i = 0; i < count; ++i) {
    bad += fabs(values[i]) < 0x1p30 ? 0 : 1; /* the comparison is false for NaN */
  }
  return bad == 0;
}

supine_status supine_check_numbers(const supine_check *c) {
  for (size_t i = 0; i < c->file->tensor_count; ++i) {
    const supine_tensor *tensor = &c->file->tensors[i];
    const size_t bytes = supine_safetensors_size(tensor);
    if ((tensor->dtype == SUPINE_F32 && !finite_floats(tensor->data, bytes / sizeof(float))) ||
        (tensor->dtype == SUPINE_F64 && !finite_doubles(tensor->data, bytes / sizeof(double)))) {
      return supine_check_refuse(c, "tensor '%s' has a number that is not finite, or 2^30 or more",
                                 tensor->name);
    }
  }
  return SUPINE_OK;
}

const void *supine_check_require(const supine_check *c, const char *name, supine_dtype dtype,
                                 size_t rank, size_t *shape) {
  const supine_tensor *tensor = supine_safetensors_find(c->file, name);
  if (tensor == NULL || tensor->dtype != dtype || tensor->rank != rank) {
    (void)supine_check_refuse(c, "tensor '%s' is missing or has a wrong type or number of axes",
                              name);
    return NULL;
  }
  for (size_t i = 0; i < rank; ++i) {
    shape[i] = shape[i] == ANY ? tensor->shape[i] : shape[i];
    if (tensor->shape[i] != shape[i]) {
      (void)supine_check_refuse(c, "axis %zu of tensor '%s' has length %zu, not %zu", i, name,
                                tensor->shape[i], shape[i]);
      return NULL;
    }
  }
  return tensor->data;
}

supine_status supine_check_read(const supine_check *c, const char *key, size_t count,
                                double *values) {
  const char *const text = supine_safetensors_metadata(c->file, key);
  const char *at = text;
  if (text == NULL) {
    return SUPINE_OK;
  }
  for (size_t i = 0; i < count; ++i) {
    char *end = NULL;
    values[i] = supine_number_parse(at, &end);
    if (end == at || *end != (i + 1 < count ? ',' : '\0') || !isfinite(values[i])) {
      return supine_check_refuse(c, "metadata '%s' is not a list of %zu finite number%s: %.48s",
                                 key, count, count == 1 ? "" : "s", text);
    }
    at = end + 1;
  }
  return SUPINE_OK;
}
