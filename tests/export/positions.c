/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute positions by the run-time library:
 *
 *     positions BASIS X,Y,Z,ML...
 *
 * X,Y,Z is the direction of gravity. ML is a volume, mL above rest (above the scan if the basis has
 * no rest volume). For an open surface, ML is instead the gain, which is the factor of the
 * displacements. For each argument, write to standard output the gain of the first lung along x
 * (float64), and the positions (float32, [N, 3]). */
#include <stdio.h>
#include <stdlib.h>

#include <supine/runtime.h>

static bool write_positions(const supine_basis *basis, const double g[3], double depth,
                            float *xyz) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  const supine_volume_kind from = info->has_rest ? SUPINE_VOLUME_REST : SUPINE_VOLUME_SCAN;
  supine_state state = {.gravity = {g[0], g[1], g[2]}};
  if (!info->is_fields || info->order > 0) {
    state.volume = (supine_volume){from, depth};
  }
  supine_pose pose;
  supine_pose_fill(&pose, depth);
  if (info->has_volume ? supine_basis_pose(basis, &state, &pose, NULL) != SUPINE_OK
                       : supine_basis_weights(basis, g, pose.weights) != SUPINE_OK) {
    return false;
  }
  supine_deform(basis, &pose, xyz);
  return fwrite(pose.gains[0], sizeof pose.gains[0][0], 1, stdout) == 1 &&
         fwrite(xyz, 3 * sizeof *xyz, info->vertex_count, stdout) == info->vertex_count;
}

int main(int argc, char **argv) {
  static const supine_basis_options exact = {sizeof exact, .storage = SUPINE_STORAGE_EXACT};
  supine_basis *basis = NULL;
  supine_error error = {.status = SUPINE_ERROR_ARGUMENT,
                        .message = "usage: positions BASIS X,Y,Z,ML..."};
  float *xyz = NULL;
  int result = EXIT_FAILURE;
  if (argc < 3 || supine_basis_open_with(argv[1], &exact, &basis, &error) != SUPINE_OK) {
    (void)fprintf(stderr, "%s\n", error.message);
    return EXIT_FAILURE;
  }
  xyz = malloc(3 * supine_basis_get_info(basis)->vertex_count * sizeof *xyz);
  for (int i = 2; i < argc; ++i) {
    double v[4];
    char *at = argv[i];
    for (int j = 0; j < 4; ++j) {
      v[j] = strtod(at, &at);
      at += *at == ',' ? 1 : 0;
    }
    if (xyz == NULL || *at != '\0' || !write_positions(basis, v, v[3], xyz)) {
      (void)fprintf(stderr, "positions: '%s' is not X,Y,Z,ML or is out of reach\n", argv[i]);
      goto cleanup;
    }
  }
  result = EXIT_SUCCESS;
cleanup:
  free(xyz);
  supine_basis_close(basis);
  return result;
}
