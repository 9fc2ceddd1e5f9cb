/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Write the golden bases of synthetic lungs to a folder, and print positions for
 * tests/runtime/test_golden.c. Golden files are made once: later versions must read them. */
#include <stdio.h>
#include <stdlib.h>

#include <supine/runtime.h>

#include "tests/helpers/runtime_fixture.h"

/* Write a golden file, and print four positions in the state that test_golden.c poses. */
static void make(const char *folder, const char *name, const fixture *f) {
  static const size_t vertices[] = {0, 7, 31, 59};
  const supine_basis_options exact = {sizeof exact, .storage = SUPINE_STORAGE_EXACT};
  char path[1024];
  supine_basis *basis = NULL;
  supine_error error = {0};
  supine_state state = {.gravity = {0.6, 0.48, -0.64}};
  supine_pose pose = {.basis = 0};
  float xyz[180];
  (void)snprintf(path, sizeof path, "%s/%s.safetensors", folder, name);
  fixture_write(f, path);
  supine_status status = supine_basis_open_with(path, &exact, &basis, &error);
  if (status == SUPINE_OK) {
    state.volume = (supine_volume){SUPINE_VOLUME_SCAN, 25};
    status = supine_basis_pose(basis, &state, &pose, &error);
  }
  if (status != SUPINE_OK || supine_deform(basis, &pose, xyz) != SUPINE_OK) {
    (void)fprintf(stderr, "%s: %s\n", path, error.message);
    exit(1);
  }
  (void)printf("%s %s\n", name, supine_basis_metadata(basis, "checksum"));
  for (size_t i = 0; i < sizeof vertices / sizeof *vertices; ++i) {
    const float *x = xyz + 3 * vertices[i];
    (void)printf("{%zu, {%.9g, %.9g, %.9g}},\n", vertices[i], (double)x[0], (double)x[1],
                 (double)x[2]);
  }
  supine_basis_close(basis);
}

int main(int argc, char **argv) {
  if (argc != 2) {
    return 1;
  }
  static const double resting[18] = {-700, 30, 0, 0, 0, 0, 0, 0, 0, -650, 25};
  static const double rest[18] = {-350, 0, 20, 0, 0, 0, 0, 0, 0, -400};
  static const double full[18] = {900, 0, 0, 0, 0, 0, 0, 0, 0, 800};
  fixture *scalar = fixture_create_shrinking(60, 2, 11);
  fixture *vector = fixture_create(60, 4, 3, 2, true, true, 4, 12);
  fixture *clusters = fixture_create(60, 5, 2, 2, true, true, 1, 13);
  fixture *simulated = fixture_create_simulated(60, 14);
  scalar->resting = resting;
  scalar->bend = "0,-0.45,0.45";
  fixture_add_normals(scalar, 6, 15);
  fixture_add_clusters(clusters, 7, 5.5, 16);
  simulated->resting = rest;
  simulated->full = full;
  make(argv[1], "basis_scalar", scalar);
  make(argv[1], "basis_vector", vector);
  make(argv[1], "basis_clusters", clusters);
  make(argv[1], "basis_simulated", simulated);
  fixture_destroy(scalar);
  fixture_destroy(vector);
  fixture_destroy(clusters);
  fixture_destroy(simulated);
  return 0;
}
