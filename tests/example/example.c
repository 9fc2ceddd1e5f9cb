/* SPDX-License-Identifier: MIT */
/* Deforms a basis file's lungs for one posture and one breath:
 *
 *     example lungs.safetensors prone 500 */
#include <stdio.h>
#include <stdlib.h>

#include <supine/posture.h>
#include <supine/runtime.h>

int main(int argc, char **argv) {
  if (argc != 4) {
    fprintf(stderr, "usage: example BASIS POSTURE MILLILITRES\n");
    return 1;
  }
  supine_error error;
  supine_basis *basis;
  if (supine_basis_open(argv[1], &basis, &error) != SUPINE_OK) {
    fprintf(stderr, "%s\n", error.message);
    return 2;
  }
  double gravity[3], weights[SUPINE_MODES_MAX], scales[SUPINE_LUNGS_MAX], scale;
  if (supine_posture_gravity(argv[2], gravity) != SUPINE_OK) {
    fprintf(stderr, "no posture %s: %s?\n", argv[2], supine_posture_nearest(argv[2]));
    return 1;
  }
  supine_basis_weights(basis, gravity, weights); /* once a frame */
  if (supine_basis_scale(basis, weights, atof(argv[3]), &scale, &error) != SUPINE_OK) {
    fprintf(stderr, "%s\n", error.message);
    return 5;
  }
  for (int i = 0; i < SUPINE_LUNGS_MAX; ++i) {
    scales[i] = scale;
  }
  size_t count = supine_basis_get_info(basis)->vertex_count;
  float *xyz = malloc(count * 3 * sizeof *xyz);
  supine_deform(basis, weights, scales, xyz); /* every vertex */
  printf("%zu vertices; the first is at %g %g %g mm\n", count, xyz[0], xyz[1], xyz[2]);
  free(xyz);
  supine_basis_close(basis);
  return 0;
}
