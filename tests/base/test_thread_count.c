/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test that a basis file has the same bytes for any number of threads. */
#include "precompute/lungs/phantom.h"
#include "precompute/precompute.h"
#include "tests/helpers/basis_helpers.h"
#include "tests/helpers/test.h"

enum { VERTICES = 9000 }; /* several blocks of each parallel sum, the last incomplete */

static supine_lungs phantom(void) {
  supine_mesh mesh = {0};
  supine_lungs lungs = {0};
  assert_int_equal(supine_phantom_create(VERTICES, 2500.0, &mesh, NULL), SUPINE_OK);
  assert_int_equal(supine_lungs_create(&mesh, 1, NULL, &lungs, NULL), SUPINE_OK);
  supine_mesh_free(&mesh);
  return lungs;
}

/* Return the bytes (malloc) and the size of a basis file computed with `threads` threads. */
static unsigned char *bytes_of(const supine_prepared *prepared, const char *threads, size_t *size) {
  char path[] = "/tmp/supine-threads-XXXXXX";
  const supine_basis_choice choice = {.band = 3, .modes = 8, .held_out = 20};
  supine_error error;
  (void)close(mkstemp(path));
  assert_int_equal(setenv("SUPINE_THREADS", threads, 1), 0);
  if (helper_write_basis(path, prepared, &choice, NULL, &error) != SUPINE_OK) {
    fail_msg("%s", error.message);
  }
  unsigned char *bytes = test_read(path, size);
  (void)unlink(path);
  return bytes;
}

static void check(double soften, double reach) {
  static const char *const threads[] = {"2", "3", "7"};
  supine_lungs lungs = phantom();
  supine_prepared prepared = {.source = {.lungs = lungs},
                              .model = supine_physics_model(SUPINE_LAW_PAPER)};
  prepared.model.force.soften = soften;
  prepared.model.reach = reach;
  size_t size;
  unsigned char *one = bytes_of(&prepared, "1", &size);
  for (size_t t = 0; t < sizeof threads / sizeof *threads; ++t) {
    size_t other_size;
    unsigned char *other = bytes_of(&prepared, threads[t], &other_size);
    assert_int_equal(other_size, size);
    for (size_t i = 0; i < size; ++i) {
      if (one[i] != other[i]) {
        fail_msg("soften %g, reach %g: byte %zu of %zu differs with %s threads", soften, reach, i,
                 size, threads[t]);
      }
    }
    free(other);
  }
  free(one);
  supine_lungs_free(&lungs);
  (void)unsetenv("SUPINE_THREADS");
}

TEST(test_basis_any_thread_count_same_bytes) {
  check(0.0, 0.0);
  check(0.0, 10.0);
  check(1.0, 10.0);
}
