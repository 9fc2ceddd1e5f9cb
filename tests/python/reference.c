/* SPDX-License-Identifier: MIT */
/* What the package for Python is held against:
 *
 *     reference BASIS POSTURE SCALE OUT   raw float32: positions and normals of supine_deform_lit
 * (of supine_deform alone, where the file has no normals), exact normals, positions of a batch of
 * two reference BASIS POSTURE SCALE       seconds that a call of supine_deform takes, on stdout */
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <supine/posture.h>
#include <supine/runtime.h>

#include "tests/poses.h"

static int write_out(const supine_basis *basis, const double *weights, const double *scales,
                     const char *path, float *xyz, float *normals) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  const size_t n = 3 * info->vertex_count;
  const size_t modes = info->mode_count;
  const size_t lungs = info->lung_count;
  double many[2 * SUPINE_MODES_MAX];
  double many_scales[2 * SUPINE_LUNGS_MAX];
  FILE *out = fopen(path, "wb");
  if (out == NULL) {
    return 2;
  }
  const bool lit =
      supine_deform_lit(basis, POSED(basis, weights, scales), xyz, normals) == SUPINE_OK;
  supine_deform(basis, POSED(basis, weights, scales), xyz);
  (void)fwrite(xyz, sizeof *xyz, n, out);
  (void)fwrite(normals, sizeof *xyz, lit ? n : 0, out);
  supine_normals(basis, xyz, normals);
  (void)fwrite(normals, sizeof *xyz, n, out);
  for (size_t i = 0; i < 2; ++i) {
    memcpy(many + i * modes, weights, modes * sizeof *many);
    for (size_t lung = 0; lung < lungs; ++lung) {
      many_scales[i * lungs + lung] = i == 0 ? scales[lung] : -0.5 * scales[lung];
    }
  }
  supine_deform_batch(basis, 2, posed_batch(basis, 2, many, many_scales), 0, n / 3, xyz);
  (void)fwrite(xyz, sizeof *xyz, 2 * n, out);
  return fclose(out) == 0 ? 0 : 2;
}

int main(int argc, char **argv) {
  enum { CALLS = 20000 };
  supine_error error;
  supine_basis *basis;
  double gravity[3];
  double weights[SUPINE_MODES_MAX];
  double scales[SUPINE_LUNGS_MAX];
  if (argc < 4 || supine_posture_gravity(argv[2], gravity) != SUPINE_OK) {
    return 1;
  }
  if (supine_basis_open(argv[1], &basis, &error) != SUPINE_OK) {
    fprintf(stderr, "%s\n", error.message);
    return 2;
  }
  const supine_basis_info *info = supine_basis_get_info(basis);
  (void)supine_basis_weights(basis, gravity, weights);
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    scales[lung] = strtod(argv[3], NULL);
  }
  float *xyz = malloc(6 * info->vertex_count * sizeof *xyz);
  float *normals = malloc(3 * info->vertex_count * sizeof *normals);
  int result = xyz == NULL || normals == NULL ? 2 : 0;
  if (result == 0 && argc > 4) {
    result = write_out(basis, weights, scales, argv[4], xyz, normals);
  } else if (result == 0) {
    const clock_t begin = clock();
    for (int i = 0; i < CALLS; ++i) {
      supine_deform(basis, POSED(basis, weights, scales), xyz);
    }
    (void)printf("%.9f\n", (double)(clock() - begin) / CLOCKS_PER_SEC / CALLS);
  }
  free(normals);
  free(xyz);
  supine_basis_close(basis);
  return result;
}
