/* SPDX-License-Identifier: GPL-3.0-or-later */
/* A made basis of any size, as a file in memory. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

#include "runtime/bench/bench.h"
#include <supine/safetensors.h>
#include <supine/sh.h>

enum { HEADER_BYTES = 2048, HUGE_PAGE = 1 << 21 };

/* Even in [-1, 1), from the number of the value alone: splitmix64. */
static float noise(uint64_t number) {
  uint64_t z = (number + 1) * UINT64_C(0x9E3779B97F4A7C15);
  z = (z ^ (z >> 30)) * UINT64_C(0xBF58476D1CE4E5B9);
  z = (z ^ (z >> 27)) * UINT64_C(0x94D049BB133111EB);
  return (float)(z >> 40) * 0x1p-23F - 1;
}

static void fill_noise(float *coefficients, float *direction, float *rest, size_t n, size_t modes) {
  for (size_t i = 0; i < n * modes; ++i) {
    coefficients[i] = 2 * noise(i) / (1 + (float)(i % modes));
  }
  for (size_t i = 0; i < 3 * n; ++i) {
    direction[i] = 5 * noise(~i);
    rest[i] = 150 * noise(~(i << 20));
  }
}

static void fill_like(const supine_basis_info *like, float *coefficients, float *direction,
                      float *rest, size_t n) {
  const size_t modes = like->mode_count;
  for (size_t i = 0; i < n; i += like->vertex_count) {
    const size_t count = n - i < like->vertex_count ? n - i : like->vertex_count;
    memcpy(coefficients + i * modes, like->coefficients, count * modes * sizeof(float));
    memcpy(direction + 3 * i, like->direction, 3 * count * sizeof(float));
    memcpy(rest + 3 * i, like->vertices, 3 * count * sizeof(float));
  }
}

supine_status supine_bench_image_create(size_t vertices, size_t modes, const supine_basis *basis,
                                        supine_bench_image *image, supine_error *error) {
  const supine_basis_info *like = basis == NULL ? NULL : supine_basis_get_info(basis);
  *image = (supine_bench_image){0};
  if (like != NULL && like->vector) {
    return supine_error_set(error, SUPINE_ERROR_UNSUPPORTED,
                            "a basis with a vector field cannot be repeated for measuring");
  }
  const size_t k = like != NULL ? like->mode_count : modes;
  size_t harmonics = like != NULL ? supine_sh_count(like->band) : 0;
  for (size_t band = 0; like == NULL && harmonics < k; ++band) {
    harmonics = supine_sh_count(band);
  }
  const size_t floats = vertices * (k + 6);
  const size_t size =
      HEADER_BYTES + k * harmonics * sizeof(double) + floats * sizeof(float) + vertices;
  const size_t room = (size + HUGE_PAGE - 1) / HUGE_PAGE * HUGE_PAGE;
  unsigned char *bytes = aligned_alloc(HUGE_PAGE, room);
  if (bytes == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu vertices", vertices);
  }
  (void)madvise(bytes, room, MADV_HUGEPAGE); /* as much as the evaluator's own memory has */
  double *mode = (double *)(void *)(bytes + HEADER_BYTES);
  float *coefficients = (float *)(void *)(mode + k * harmonics);
  float *direction = coefficients + vertices * k;
  float *rest = direction + 3 * vertices;
  unsigned char *lung = (unsigned char *)(rest + 3 * vertices);
  memset(lung, 0, vertices);
  memset(mode, 0, k * harmonics * sizeof *mode);
  if (like != NULL) {
    memcpy(mode, like->modes, k * harmonics * sizeof *mode);
    fill_like(like, coefficients, direction, rest, vertices);
  } else {
    for (size_t i = 0; i < k; ++i) {
      mode[i * harmonics + i] = 1;
    }
    fill_noise(coefficients, direction, rest, vertices, k);
  }
  const supine_tensor tensors[] = {
      {"modes", SUPINE_F64, 2, {k, harmonics}, mode},
      {"coefficients", SUPINE_F32, 2, {vertices, k}, coefficients},
      {"direction", SUPINE_F32, 2, {vertices, 3}, direction},
      {"vertices", SUPINE_F32, 2, {vertices, 3}, rest},
      {"triangles", SUPINE_U32, 2, {0, 3}, lung},
      {"lung", SUPINE_U8, 1, {vertices}, lung},
  };
  const supine_metadata metadata[] = {
      {"format", "supine-basis"}, {"version", "2"}, {"kind", "scalar"}};
  const size_t at[] = {0,
                       k * harmonics * sizeof *mode,
                       (size_t)((unsigned char *)direction - bytes) - HEADER_BYTES,
                       (size_t)((unsigned char *)rest - bytes) - HEADER_BYTES,
                       (size_t)(lung - bytes) - HEADER_BYTES,
                       (size_t)(lung - bytes) - HEADER_BYTES,
                       (size_t)(lung - bytes) - HEADER_BYTES + vertices};
  const uint64_t checksum = supine_safetensors_checksum(tensors, 6, metadata, 3);
  char header[HEADER_BYTES - 8 + 1];
  (void)snprintf(
      header, sizeof header,
      "{\"__metadata__\":{\"format\":\"supine-basis\",\"version\":\"2\",\"kind\":"
      "\"scalar\",\"checksum\":\"xxh64:%016" PRIx64 "\"},"
      "\"modes\":{\"dtype\":\"F64\",\"shape\":[%zu,%zu],\"data_offsets\":[%zu,%zu]},"
      "\"coefficients\":{\"dtype\":\"F32\",\"shape\":[%zu,%zu],\"data_offsets\":[%zu,%zu]},"
      "\"direction\":{\"dtype\":\"F32\",\"shape\":[%zu,3],\"data_offsets\":[%zu,%zu]},"
      "\"vertices\":{\"dtype\":\"F32\",\"shape\":[%zu,3],\"data_offsets\":[%zu,%zu]},"
      "\"triangles\":{\"dtype\":\"U32\",\"shape\":[0,3],\"data_offsets\":[%zu,%zu]},"
      "\"lung\":{\"dtype\":\"U8\",\"shape\":[%zu],\"data_offsets\":[%zu,%zu]}}",
      checksum, k, harmonics, at[0], at[1], vertices, k, at[1], at[2], vertices, at[2], at[3],
      vertices, at[3], at[4], at[4], at[5], vertices, at[5], at[6]);
  const size_t length = strlen(header);
  const uint64_t prefix = HEADER_BYTES - 8;
  memcpy(bytes, &prefix, 8);
  memset(bytes + 8, ' ', HEADER_BYTES - 8);
  memcpy(bytes + 8, header, length); /* NOLINT(bugprone-not-null-terminated-result) */
  *image = (supine_bench_image){bytes, size, vertices, k, coefficients, direction, rest};
  return SUPINE_OK;
}

void supine_bench_image_destroy(supine_bench_image *image) {
  free(image->bytes);
  *image = (supine_bench_image){0};
}
