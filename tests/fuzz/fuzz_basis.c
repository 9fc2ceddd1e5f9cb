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

static void evaluate(const supine_basis *basis) {
  static float xyz[3 * VERTICES_MOST];
  static const double gravity[3] = {0.3, 0.8, -0.52};
  const supine_basis_info *info = supine_basis_get_info(basis);
  double weights[SUPINE_MODES_MAX];
  double scales[SUPINE_LUNGS_MAX];
  double scale = 1.0;
  supine_fuzz_expect(info->mode_count <= SUPINE_MODES_MAX && info->lung_count <= SUPINE_LUNGS_MAX,
                     "at most SUPINE_MODES_MAX modes and SUPINE_LUNGS_MAX lungs");
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
  const size_t count = info->vertex_count < VERTICES_MOST ? info->vertex_count : VERTICES_MOST;
  supine_deform_range(basis, POSED(basis, weights, scales), 0, count, xyz);
  for (size_t i = 0; i < 3 * count; ++i) {
    supine_fuzz_expect(!isnan(xyz[i]), "positions without NaN");
  }
}

static void open_and_evaluate(const uint8_t *bytes, size_t size) {
  supine_basis *basis = NULL;
  supine_error error = {0};
  const supine_status status = supine_basis_open_memory(bytes, size, &basis, &error);
  supine_fuzz_expect((status == SUPINE_OK) == (basis != NULL),
                     "either a basis or an error, not both");
  supine_fuzz_expect(status == SUPINE_OK || (error.status == status && error.message[0] != '\0'),
                     "an error with its status and a message");
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

uint8_t *supine_fuzz_seed(size_t index, size_t *size) {
  static const struct {
    size_t vertices, modes, band, lungs;
    bool vector, volume;
  } kinds[] = {{12, 2, 1, 2, false, true}, {7, 3, 2, 1, true, false}, {20, 1, 0, 1, false, false}};
  if (index >= sizeof kinds / sizeof *kinds) {
    return NULL;
  }
  fixture *f =
      fixture_create(kinds[index].vertices, kinds[index].modes, kinds[index].band,
                     kinds[index].lungs, kinds[index].vector, kinds[index].volume, 3.0, 77);
  uint8_t *bytes = fixture_bytes(f, size);
  fixture_destroy(f);
  return bytes;
}
