/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute reference results for the JavaScript package, in portable C (SUPINE_SIMD_PORTABLE).
 *
 *     native BASIS STATE OUT    write the volume of each lung as float64. Then write as float32 the
 *                               positions, the normals by supine_deform_lit (or by supine_normals
 *                               if the file has no normals) and the expected errors (0 if unknown)
 *     native BASIS STATE        print the times of supine_deform and of supine_deform_lit (0 if the
 *                               file has no normals), ns per vertex: fastest of nine runs */
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include <supine/locate.h>
#include <supine/runtime.h>

static double seconds(void) {
  struct timespec now;
  (void)clock_gettime(CLOCK_MONOTONIC, &now);
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static void measure(const supine_basis *basis, const supine_pose *pose, float *xyz,
                    float *normals) {
  enum { ROUNDS = 9, VERTICES = 1000000 };
  const supine_basis_info *info = supine_basis_get_info(basis);
  const size_t calls = VERTICES / info->vertex_count + 1;
  double fastest[2] = {1e9, 1e9};
  for (int round = 0; round < 2 * ROUNDS; ++round) {
    const bool lit = round % 2 != 0;
    const double begin = seconds();
    for (size_t i = 0; i < calls; ++i) {
      if (lit) {
        (void)supine_deform_lit(basis, pose, xyz, normals);
      } else {
        supine_deform(basis, pose, xyz);
      }
    }
    const double taken = seconds() - begin;
    fastest[lit] = taken < fastest[lit] ? taken : fastest[lit];
  }
  const double each = 1e9 / (double)calls / (double)info->vertex_count;
  (void)printf("%.4f %.4f\n", each * fastest[0], info->normal_count > 0 ? each * fastest[1] : 0);
}

static bool write_out(const supine_basis *basis, const supine_state *state, const supine_pose *pose,
                      const char *path, float *xyz, float *normals) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  const size_t n = info->vertex_count;
  double volumes[SUPINE_LUNGS_MAX] = {0};
  FILE *out = fopen(path, "wb");
  if (out == NULL) {
    return false;
  }
  if (info->has_volume) {
    supine_basis_volumes(basis, pose, volumes);
  }
  supine_deform(basis, pose, xyz);
  if (info->normal_count > 0) {
    (void)supine_deform_lit(basis, pose, NULL, normals);
  } else {
    supine_normals(basis, xyz, normals); /* supine_deform_lit must agree */
  }
  bool done = fwrite(volumes, sizeof *volumes, info->lung_count, out) == info->lung_count &&
              fwrite(xyz, 3 * sizeof *xyz, n, out) == n &&
              fwrite(normals, 3 * sizeof *normals, n, out) == n;
  if (supine_expected_error(basis, state, NULL, xyz, NULL) != SUPINE_OK) {
    for (size_t i = 0; i < n; ++i) {
      xyz[i] = 0;
    }
  }
  done = fwrite(xyz, sizeof *xyz, n, out) == n && done;
  return fclose(out) == 0 && done;
}

int main(int argc, char **argv) {
  static const supine_basis_options plain = {sizeof plain, .simd = SUPINE_SIMD_PORTABLE};
  supine_error error = {.status = SUPINE_ERROR_ARGUMENT,
                        .message = "usage: native BASIS STATE [OUT]"};
  supine_basis *basis = NULL;
  supine_state state = {.gravity = {0, 1, 0}};
  supine_pose pose;
  if (argc < 3 || supine_basis_open_with(argv[1], &plain, &basis, &error) != SUPINE_OK ||
      supine_state_parse(argv[2], &state, &error) != SUPINE_OK ||
      supine_basis_pose(basis, &state, &pose, &error) != SUPINE_OK) {
    (void)fprintf(stderr, "%s\n", error.message);
    supine_basis_close(basis);
    return EXIT_FAILURE;
  }
  const size_t n = supine_basis_get_info(basis)->vertex_count;
  float *xyz = malloc(3 * n * sizeof *xyz);
  float *normals = malloc(3 * n * sizeof *normals);
  int result = xyz != NULL && normals != NULL ? EXIT_SUCCESS : EXIT_FAILURE;
  if (result == EXIT_SUCCESS && argc == 3) {
    measure(basis, &pose, xyz, normals);
  } else if (result == EXIT_SUCCESS && !write_out(basis, &state, &pose, argv[3], xyz, normals)) {
    result = EXIT_FAILURE;
  }
  free(normals);
  free(xyz);
  supine_basis_close(basis);
  return result;
}
