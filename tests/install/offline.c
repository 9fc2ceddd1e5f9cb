/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Make a basis from arrays with the installed offline library, and pose it:
 *
 *     offline SURFACE
 *
 * SURFACE has the numbers of vertices and triangles, then the coordinates, then the corners. Check
 * also what happens when the work is stopped, and when an option is wrong. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <supine/precompute.h>
#include <supine/runtime.h>

#define CHECK(right)                                                                               \
  if (!(right)) {                                                                                  \
    (void)fprintf(stderr, "offline.c:%d: %s: %s\n", __LINE__, #right, error.message);              \
    return 1;                                                                                      \
  }

typedef struct calls {
  double last, stop_at;
  int backwards;
} calls;

static int progress(void *context, double fraction) {
  calls *seen = context;
  seen->backwards += fraction < seen->last;
  seen->last = fraction;
  return fraction >= seen->stop_at;
}

int main(int argc, char **argv) {
  supine_error error = {.message = ""};
  FILE *file = argc == 2 ? fopen(argv[1], "r") : NULL;
  size_t n = 0;
  size_t m = 0;
  CHECK(file != NULL && fscanf(file, "%zu %zu", &n, &m) == 2);
  double *vertices = malloc(3 * n * sizeof *vertices);
  uint32_t *triangles = malloc(3 * m * sizeof *triangles);
  for (size_t i = 0; i < 3 * n; ++i) {
    CHECK(fscanf(file, "%lf", &vertices[i]) == 1);
  }
  for (size_t i = 0; i < 3 * m; ++i) {
    CHECK(fscanf(file, "%u", &triangles[i]) == 1);
  }
  (void)fclose(file);
  const supine_precompute_surface surface = {n, vertices, m, triangles};
  calls seen = {.stop_at = 2.0};
  supine_precompute_options options = {
      .size = sizeof options,
      .lungs = {.surfaces = &surface, .surface_count = 1},
      .tissue = {.lesion_count = 1, .lesions = {{{60.0, -20.0, 0.0}, 40.0, 3.0}}},
      .modes = {.count = 8, .held_out = 20},
      .progress = progress,
      .context = &seen};
  supine_precompute_result *result = NULL;
  CHECK(supine_precompute_basis(&options, &result, &error) == SUPINE_OK);
  CHECK(seen.last == 1.0 && seen.backwards == 0);
  CHECK(result->report.lung_count == 2 && result->report.mm.rms > 0.0);
  CHECK(result->assumption_count > 0 && result->findings->count > 0);
  CHECK(strstr(result->findings->list[0].text, "the lesion at 60,-20,0 is") != NULL);
  supine_basis *basis = NULL;
  supine_state state;
  supine_pose pose;
  CHECK(supine_basis_open_memory(result->bytes, result->size, &basis, &error) == SUPINE_OK);
  CHECK(supine_state_parse("prone:rest", &state, &error) == SUPINE_OK);
  CHECK(supine_basis_pose(basis, &state, &pose, &error) == SUPINE_OK);
  float *xyz = malloc(3 * n * sizeof *xyz);
  CHECK(supine_basis_get_info(basis)->vertex_count == n &&
        supine_deform(basis, &pose, xyz) == SUPINE_OK);
  printf("%zu vertices, %zu modes\n", n, supine_basis_get_info(basis)->mode_count);
  supine_basis_close(basis);
  supine_precompute_result_free(result);

  seen = (calls){.stop_at = 0.5};
  CHECK(supine_precompute_basis(&options, &result, &error) == SUPINE_ERROR_INTERRUPTED);
  CHECK(result->bytes == NULL && seen.last >= 0.5 && seen.last < 1.0);
  supine_precompute_result_free(result);
  seen = (calls){.stop_at = 2.0};
  options.modes.count = 65;
  CHECK(supine_precompute_basis(&options, &result, &error) == SUPINE_ERROR_ARGUMENT);
  CHECK(strstr(error.message, "give 1 to 64") != NULL);
  supine_precompute_result_free(result);
  options.modes.count = 8;
  triangles[0] = (uint32_t)n;
  CHECK(supine_precompute_basis(&options, &result, &error) == SUPINE_ERROR_FORMAT);
  CHECK(strstr(error.message, "surface 1: face 0 names vertex") != NULL && result->bytes == NULL);
  supine_precompute_result_free(result);
  free(vertices);
  free(triangles);
  free(xyz);
  return 0;
}
