/* SPDX-License-Identifier: MIT */
/* Deform the lungs of a basis file to one state, which is a posture and a volume:
 *
 *     deform lungs.safetensors prone:rest+500 */
#include <stdio.h>
#include <stdlib.h>

#include <supine/runtime.h>

int main(int argc, char **argv) {
  if (argc != 3) {
    fprintf(stderr, "usage: deform BASIS STATE\n");
    return 1;
  }
  supine_error error;
  supine_basis *basis;
  supine_state state = {.gravity = {0, 1, 0}}; /* supine, if argv[2] names no posture */
  supine_pose pose;
  if (supine_basis_open(argv[1], &basis, &error) != SUPINE_OK ||
      supine_state_parse(argv[2], &state, &error) != SUPINE_OK ||
      supine_basis_pose(basis, &state, &pose, &error) != SUPINE_OK) { /* once per frame */
    fprintf(stderr, "%s\n", error.message);
    return 2;
  }
  size_t count = supine_basis_get_info(basis)->vertex_count;
  float *xyz = malloc(count * 3 * sizeof *xyz);
  if (xyz == NULL || supine_deform(basis, &pose, xyz) != SUPINE_OK) { /* all vertices */
    fprintf(stderr, "no memory, or another basis's pose\n");
    return 3;
  }
  printf("%zu vertices; the first is at %g %g %g mm\n", count, xyz[0], xyz[1], xyz[2]);
  free(xyz);
  supine_basis_close(basis);
  return 0;
}
