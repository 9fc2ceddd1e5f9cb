/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Fuzz basis files. Each file is opened twice: unchanged, and with the correct checksum, without
 * which it would be refused before most of the code runs. A basis that opens is evaluated. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <supine/runtime.h>

#include "runtime/safetensors/safetensors_file.h"
#include "tests/helpers/runtime_fixture.h"

#include "fuzz.h"

#include "tests/helpers/poses.h"

/* Largest number of vertices to evaluate, because a small file may claim to have very many. */
enum { VERTICES_MOST = 4096 };

static float positions[3 * VERTICES_MOST];

static void expect_numbers(size_t count) {
  for (size_t i = 0; i < 3 * count; ++i) {
    supine_fuzz_expect(!isnan(positions[i]), "positions without NaN");
  }
}

/* Evaluate a basis whose weights depend on gravity alone. */
static void evaluate_weights(const supine_basis *basis, const double gravity[3], size_t count) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  double weights[SUPINE_MODES_MAX];
  double scales[SUPINE_LUNGS_MAX];
  double scale = 1.0;
  supine_fuzz_expect(supine_basis_weights(basis, gravity, weights) == SUPINE_OK,
                     "weights of the modes for a direction of gravity");
  for (size_t k = 0; k < info->mode_count; ++k) {
    supine_fuzz_expect(isfinite(weights[k]), "finite weights of the modes");
  }
  if (info->has_volume && posed_scale(basis, weights, 500.0, &scale, NULL) == SUPINE_OK) {
    supine_fuzz_expect(isfinite(scale), "a finite gain for 500 mL");
  }
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    scales[lung] = 1.0;
  }
  supine_deform_range(basis, POSED(basis, weights, scales), 0, count, positions);
  expect_numbers(count);
}

static void evaluate(const supine_basis *basis) {
  static const double gravity[3] = {0.3, 0.8, -0.52};
  const supine_basis_info *info = supine_basis_get_info(basis);
  supine_fuzz_expect(info->mode_count <= SUPINE_MODES_MAX && info->lung_count <= SUPINE_LUNGS_MAX,
                     "at most SUPINE_MODES_MAX modes and SUPINE_LUNGS_MAX lungs");
  const size_t count = info->vertex_count < VERTICES_MOST ? info->vertex_count : VERTICES_MOST;
  if (info->order == 0) {
    evaluate_weights(basis, gravity, count);
    return;
  }
  const supine_state state = {.gravity = {gravity[0], gravity[1], gravity[2]}};
  supine_pose pose;
  if (supine_basis_pose(basis, &state, &pose, NULL) == SUPINE_OK) {
    supine_deform_range(basis, &pose, 0, count, positions);
    expect_numbers(count);
  }
}
static void open_and_evaluate(const uint8_t *bytes, size_t size) {
  supine_basis *basis = NULL;
  supine_error error = {0};
  const supine_status status = supine_basis_open_memory(bytes, size, &basis, &error);
  supine_fuzz_expect((status == SUPINE_OK) == (basis != NULL),
                     "either a basis or an error, not both");
  supine_fuzz_expect_words(status, &error);
  if (basis != NULL) {
    evaluate(basis);
  }
  supine_basis_close(basis);
}

/* Replace the checksum in the file by the correct one. Return false if the file has no checksum. */
static bool correct_checksum(uint8_t *bytes, size_t size) {
  supine_safetensors *file = NULL;
  if (supine_safetensors_open_memory(bytes, size, "input", &file, NULL) != SUPINE_OK) {
    return false;
  }
  const char *stated = supine_safetensors_metadata(file, "checksum");
  const size_t length = stated == NULL ? 0 : strlen(stated);
  char text[CHECKSUM_SIZE];
  (void)snprintf(text, sizeof text, CHECKSUM_FORMAT,
                 supine_safetensors_checksum(file->tensors, file->tensor_count, file->metadata,
                                             file->metadata_count));
  uint8_t *place =
      length == 0 || length != strlen(text) ? NULL : memmem(bytes, size, stated, length);
  if (place != NULL) {
    memcpy(place, text, length);
  }
  supine_safetensors_close(file);
  return place != NULL;
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size) {
  open_and_evaluate(bytes, size);
  uint8_t *copy = malloc(size + 1);
  supine_fuzz_expect(copy != NULL, "memory for a copy");
  memcpy(copy, bytes, size);
  if (correct_checksum(copy, size)) {
    open_and_evaluate(copy, size);
  }
  free(copy);
  return 0;
}

/* Make a synthetic basis of each kind. Return NULL after the last. */
static fixture *make_seed(size_t index) {
  fixture *f = NULL;
  switch (index) {
  case 0:
    return fixture_create(12, 2, 1, 2, false, true, 3.0, 77);
  case 1:
    return fixture_create(7, 3, 2, 1, true, false, 3.0, 77);
  case 2:
    return fixture_create(20, 1, 0, 1, false, false, 3.0, 77);
  case 3:
    f = fixture_create(12, 2, 1, 2, true, true, 3.0, 77);
    fixture_add_clusters(f, 3, 3.0, 78);
    return f;
  case 4:
    return fixture_create_simulated(12, 77);
  default:
    return NULL;
  }
}

uint8_t *supine_fuzz_seed(size_t index, size_t *size) {
  fixture *f = make_seed(index);
  if (f == NULL) {
    return NULL;
  }
  uint8_t *bytes = fixture_bytes(f, size);
  fixture_destroy(f);
  return bytes;
}
