/* SPDX-License-Identifier: GPL-3.0-or-later */
/* A made basis of any size, as a file in memory. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

#include "evaluation.h"
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

/* The fields of `like` over and over. */
static void fill_like(const supine_basis_info *like, const supine_bench_image *image) {
  const size_t modes = like->mode_count;
  const size_t normals = 3 * like->normal_count;
  for (size_t i = 0; i < image->vertices; i += like->vertex_count) {
    const size_t left = image->vertices - i;
    const size_t count = left < like->vertex_count ? left : like->vertex_count;
    memcpy(image->coefficients + i * modes, like->coefficients, count * modes * sizeof(float));
    memcpy(image->direction + 3 * i, like->direction, 3 * count * sizeof(float));
    memcpy(image->rest + 3 * i, like->vertices, 3 * count * sizeof(float));
    if (normals > 0) {
      memcpy(image->normals + i * normals, like->normals, count * normals * sizeof(int16_t));
    }
  }
}

/* The triangles of `like` again for each of its repetitions, but those that the last one cuts;
 * returns how many. `triangles` NULL: counts alone. */
static size_t repeat_triangles(const supine_basis_info *like, size_t vertices,
                               uint32_t *triangles) {
  size_t found = 0;
  for (size_t base = 0; base < vertices; base += like->vertex_count) {
    for (size_t t = 0; t < like->triangle_count; ++t) {
      const uint32_t *corner = like->triangles + 3 * t;
      const bool whole =
          base + corner[0] < vertices && base + corner[1] < vertices && base + corner[2] < vertices;
      for (size_t j = 0; whole && triangles != NULL && j < 3; ++j) {
        triangles[3 * found + j] = (uint32_t)(base + corner[j]);
      }
      found += whole;
    }
  }
  return found;
}

/* The image's tensors, from the numbers of most bytes to those of fewest, so that all are aligned.
 */
enum {
  MODES,
  NORMAL_WEIGHTS,
  COEFFICIENTS,
  DIRECTION,
  VERTICES,
  TRIANGLES,
  NORMALS,
  LUNG,
  TENSORS
};

static const struct {
  const char *name, *type;
  supine_dtype dtype;
  size_t size;
} kind[TENSORS] = {{"modes", "F64", SUPINE_F64, 8},        {"normal_weights", "F64", SUPINE_F64, 8},
                   {"coefficients", "F32", SUPINE_F32, 4}, {"direction", "F32", SUPINE_F32, 4},
                   {"vertices", "F32", SUPINE_F32, 4},     {"triangles", "U32", SUPINE_U32, 4},
                   {"normals", "I16", SUPINE_I16, 2},      {"lung", "U8", SUPINE_U8, 1}};

static size_t tensor_bytes(const supine_tensor *tensor, size_t which) {
  size_t bytes = kind[which].size;
  for (size_t i = 0; i < tensor->rank; ++i) {
    bytes *= tensor->shape[i];
  }
  return bytes;
}

/* Shapes of the file, without its numbers; the normals' are left out where Q is 0. */
static void shape_tensors(supine_tensor *tensors, size_t vertices, size_t modes, size_t harmonics,
                          size_t triangles, size_t normals) {
  const size_t shapes[TENSORS][3] = {
      {modes, harmonics},     {1, normals, (modes + 1) * (modes + 2) / 2},
      {vertices, modes},      {vertices, 3},
      {vertices, 3},          {triangles, 3},
      {vertices, 3, normals}, {vertices}};
  static const size_t ranks[TENSORS] = {2, 3, 2, 2, 2, 2, 3, 1};
  for (size_t i = 0; i < TENSORS; ++i) {
    tensors[i] = (supine_tensor){.name = kind[i].name, .dtype = kind[i].dtype, .rank = ranks[i]};
    memcpy(tensors[i].shape, shapes[i], ranks[i] * sizeof(size_t));
  }
}

/* The header in its room, of the tensors that hold something or must be there. */
static void write_header(unsigned char *bytes, const supine_tensor *tensors) {
  const supine_metadata metadata[] = {
      {"format", "supine-basis"}, {"version", "2"}, {"kind", "scalar"}};
  const bool lit = tensors[NORMALS].shape[2] > 0;
  supine_tensor there[TENSORS];
  size_t count = 0;
  size_t at = 0;
  char text[HEADER_BYTES - 8 + 1];
  size_t length = 0;
  for (size_t i = 0; i < TENSORS; ++i) {
    if (lit || (i != NORMALS && i != NORMAL_WEIGHTS)) {
      there[count++] = tensors[i];
    }
  }
  length += (size_t)snprintf(
      text, sizeof text,
      "{\"__metadata__\":{\"format\":\"supine-basis\",\"version\":\"2\",\"kind\":\"scalar\","
      "\"checksum\":\"xxh64:%016" PRIx64 "\"}",
      supine_safetensors_checksum(there, count, metadata, 3));
  for (size_t i = 0; i < TENSORS; ++i) {
    if (!lit && (i == NORMALS || i == NORMAL_WEIGHTS)) {
      continue;
    }
    const supine_tensor *t = &tensors[i];
    const size_t end = at + tensor_bytes(t, i);
    length += (size_t)snprintf(text + length, sizeof text - length,
                               ",\"%s\":{\"dtype\":\"%s\",\"shape\":[%zu", t->name, kind[i].type,
                               t->shape[0]);
    for (size_t j = 1; j < t->rank; ++j) {
      length += (size_t)snprintf(text + length, sizeof text - length, ",%zu", t->shape[j]);
    }
    length += (size_t)snprintf(text + length, sizeof text - length, "],\"data_offsets\":[%zu,%zu]}",
                               at, end);
    at = end;
  }
  text[length++] = '}';
  const uint64_t prefix = HEADER_BYTES - 8;
  memcpy(bytes, &prefix, 8);
  memset(bytes + 8, ' ', HEADER_BYTES - 8);
  memcpy(bytes + 8, text, length); /* NOLINT(bugprone-not-null-terminated-result) */
}

static void fill(const supine_basis_info *like, const supine_tensor *tensors,
                 const supine_bench_image *image) {
  double *mode = (double *)(uintptr_t)tensors[MODES].data;
  const size_t k = image->modes;
  memset((void *)(uintptr_t)tensors[LUNG].data, 0, image->vertices);
  memset(mode, 0, tensor_bytes(&tensors[MODES], MODES));
  if (like == NULL) {
    for (size_t i = 0; i < k; ++i) {
      mode[i * tensors[MODES].shape[1] + i] = 1;
    }
    fill_noise(image->coefficients, image->direction, image->rest, image->vertices, k);
    return;
  }
  memcpy(mode, like->modes, tensor_bytes(&tensors[MODES], MODES));
  fill_like(like, image);
  (void)repeat_triangles(like, image->vertices, image->triangles);
  if (like->normal_count > 0) { /* one lung here: as the first there */
    memcpy((void *)(uintptr_t)tensors[NORMAL_WEIGHTS].data, like->normal_weights,
           tensor_bytes(&tensors[NORMAL_WEIGHTS], NORMAL_WEIGHTS));
  }
}

supine_status supine_bench_image_create(size_t vertices, size_t modes, const supine_basis *basis,
                                        supine_bench_image *image, supine_error *error) {
  const supine_basis_info *like = basis == NULL ? NULL : supine_basis_get_info(basis);
  supine_tensor tensors[TENSORS];
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
  const size_t triangles = like != NULL ? repeat_triangles(like, vertices, NULL) : 0;
  const size_t normals = like != NULL ? like->normal_count : 0;
  shape_tensors(tensors, vertices, k, harmonics, triangles, normals);
  size_t size = HEADER_BYTES;
  for (size_t i = 0; i < TENSORS; ++i) {
    size += tensor_bytes(&tensors[i], i);
  }
  const size_t room = (size + HUGE_PAGE - 1) / HUGE_PAGE * HUGE_PAGE;
  unsigned char *bytes = aligned_alloc(HUGE_PAGE, room);
  if (bytes == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu vertices", vertices);
  }
  (void)madvise(bytes, room, MADV_HUGEPAGE); /* as much as the evaluator's own memory has */
  unsigned char *part[TENSORS];
  for (size_t i = 0; i < TENSORS; ++i) {
    part[i] = i == 0 ? bytes + HEADER_BYTES : part[i - 1] + tensor_bytes(&tensors[i - 1], i - 1);
    tensors[i].data = part[i];
  }
  *image = (supine_bench_image){.bytes = bytes,
                                .size = size,
                                .vertices = vertices,
                                .modes = k,
                                .triangle_count = triangles,
                                .normal_count = normals,
                                .coefficients = (float *)(void *)part[COEFFICIENTS],
                                .direction = (float *)(void *)part[DIRECTION],
                                .rest = (float *)(void *)part[VERTICES],
                                .triangles = (uint32_t *)(void *)part[TRIANGLES],
                                .normals = (int16_t *)(void *)part[NORMALS]};
  fill(like, tensors, image);
  write_header(bytes, tensors);
  return SUPINE_OK;
}

void supine_bench_image_destroy(supine_bench_image *image) {
  free(image->bytes);
  *image = (supine_bench_image){0};
}
