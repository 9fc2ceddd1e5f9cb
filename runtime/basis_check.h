/* SPDX-License-Identifier: MIT */
/* Check what a basis file holds, before anything uses it. */
#ifndef SUPINE_BASIS_CHECK_H
#define SUPINE_BASIS_CHECK_H

#include "runtime/internal.h"
#include "runtime/safetensors/safetensors_file.h"

/* A file to check, and the name of the file in messages. */
typedef struct supine_check {
  const supine_safetensors *file;
  const char *name;
  supine_error *error;
} supine_check;

/* Refuse the file: say what is wrong, and to make it again. */
supine_status SUPINE_PRINTF(2, 3)
    supine_check_refuse(const supine_check *c, const char *format, ...);

/* Check all numbers of all tensors of the file, also of those that this library does not read. */
supine_status supine_check_numbers(const supine_check *c);

/* Length to pass to supine_check_require for an axis that may have any length. */
#define ANY SIZE_MAX

/* Find a tensor and check its type and shape. Replace each ANY in `shape` by the length of
 * that axis. Return the numbers of the tensor; if a check fails, set the error and return NULL. */
const void *supine_check_require(const supine_check *c, const char *name, supine_dtype dtype,
                                 size_t rank, size_t *shape);

/* Set a pointer to the numbers of a tensor by supine_check_require. If a check fails, return from
 * the calling function. */
#define REQUIRE(pointer, ...)                                                                      \
  do {                                                                                             \
    (pointer) = supine_check_require(__VA_ARGS__);                                                 \
    if ((pointer) == NULL) {                                                                       \
      return SUPINE_ERROR_FORMAT;                                                                  \
    }                                                                                              \
  } while (0)

/* Parse the metadata `key`, which must hold `count` numbers separated by commas. Leave `values`
 * unchanged if the file has no such metadata. */
supine_status supine_check_read(const supine_check *c, const char *key, size_t count,
                                double *values);

/* Check the surface, the coefficients and their modes, and find the lungs (basis_shape.c). */
supine_status supine_check_shape(const supine_check *c, supine_basis *basis);
/* Check what is known of the volumes of the lungs, and of the scan (basis_volume.c). */
supine_status supine_check_volumes(const supine_check *c, supine_basis *basis);
/* Check what else vertices have: normals, rigid parts, and names (basis_vertices.c). */
supine_status supine_check_vertices(const supine_check *c, supine_basis *basis);
/* Check what expected errors are computed from (basis_errors.c). */
supine_status supine_check_errors(const supine_check *c, supine_basis *basis);

#endif
