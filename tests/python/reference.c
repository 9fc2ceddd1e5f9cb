/* SPDX-License-Identifier: MIT */
/* Compute reference results for the Python package.
 *
 *     reference BASIS STATE        print the time of a call of supine_deform, s
 *     reference BASIS STATE OUT    write as float32, in this order:
 *
 * - positions and normals by supine_deform_lit in STATE
 * - normals of these positions by supine_normals
 * - positions by supine_deform_batch in STATE, and in the state "supine" */
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include <supine/runtime.h>

static int write_out(const supine_basis *basis, const supine_pose *poses, const char *path,
                     float *xyz, float *normals) {
  const size_t n = supine_basis_get_info(basis)->vertex_count;
  FILE *out = fopen(path, "wb");
  if (out == NULL || supine_deform_lit(basis, poses, xyz, normals) != SUPINE_OK) {
    return 2;
  }
  (void)fwrite(xyz, sizeof *xyz, 3 * n, out);
  (void)fwrite(normals, sizeof *xyz, 3 * n, out);
  supine_normals(basis, xyz, normals);
  (void)fwrite(normals, sizeof *xyz, 3 * n, out);
  supine_deform_batch(basis, 2, poses, 0, n, xyz);
  (void)fwrite(xyz, sizeof *xyz, 6 * n, out);
  return fclose(out) == 0 ? 0 : 2;
}

int main(int argc, char **argv) {
  enum { CALLS = 20000 };
  supine_error error;
  supine_basis *basis = NULL;
  supine_state states[2] = {{.gravity = {0, 1, 0}}, {.gravity = {0, 1, 0}}};
  supine_pose poses[2];
  if (argc < 3) {
    return 1;
  }
  if (supine_basis_open(argv[1], &basis, &error) != SUPINE_OK ||
      supine_state_parse(argv[2], &states[0], &error) != SUPINE_OK ||
      supine_basis_pose(basis, &states[0], &poses[0], &error) != SUPINE_OK ||
      supine_basis_pose(basis, &states[1], &poses[1], &error) != SUPINE_OK) {
    fprintf(stderr, "%s\n", error.message);
    supine_basis_close(basis);
    return 2;
  }
  const size_t n = supine_basis_get_info(basis)->vertex_count;
  float *xyz = malloc(6 * n * sizeof *xyz);
  float *normals = malloc(3 * n * sizeof *normals);
  int result = xyz == NULL || normals == NULL ? 2 : 0;
  if (result == 0 && argc > 3) {
    result = write_out(basis, poses, argv[3], xyz, normals);
  } else if (result == 0) {
    const clock_t begin = clock();
    for (int i = 0; i < CALLS; ++i) {
      supine_deform(basis, poses, xyz);
    }
    (void)printf("%.9f\n", (double)(clock() - begin) / CLOCKS_PER_SEC / CALLS);
  }
  free(normals);
  free(xyz);
  supine_basis_close(basis);
  return result;
}
