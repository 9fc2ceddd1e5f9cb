/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The library needs no larger stack than <supine/runtime.h> states. */
#include <pthread.h>
#include <sys/mman.h>

#include "tests/helpers/test.h"

#include <supine/breath.h>
#include <supine/compare.h>
#include <supine/doubt.h>
#include <supine/locate.h>
#include <supine/posture.h>
#include <supine/runtime.h>

#include "tests/helpers/runtime_fixture.h"

#include "tests/helpers/poses.h"

enum {
  VERTICES = 1200,
  SEEN = SUPINE_LOCATE_POINTS_MAX,
  SLABS = 8,
  COVARIED = 40,
  STATED = 128 << 10, /* stack that the header states, bytes */
  BELOW = 1 << 20,    /* memory below the stack, where a deeper stack would show, bytes */
  PAINT = 0xA5
};

/* Arguments and results of the thread, so that its own frames are small. */
typedef struct work {
  unsigned char *bytes;
  size_t size;
  void (*use)(struct work *work);
  supine_basis *basis;
  supine_state state;
  supine_pose pose, other;
  supine_error error;
  float xyz[VERTICES * (SUPINE_GL_FLOATS + SUPINE_GL_MODES)], second[3 * VERTICES];
  float distance[VERTICES];
  supine_gl_clustered_vertex clustered[VERTICES];
  float frames[SUPINE_CLUSTERS_MAX * SUPINE_GL_FRAME_FLOATS];
  double numbers[SUPINE_MODES_MAX];
  supine_distance_statistics statistics;
  double energy[3 * SUPINE_MODES_MAX * SUPINE_MODES_MAX];
  supine_slab slabs[SUPINE_LUNGS_MAX * SLABS];
  supine_expected_part parts[SUPINE_EXPECTED_TERMS];
  supine_observation seen[SEEN];
  supine_locate_residual residuals[SEEN];
  double *space, *doubt_space, *mend_space;
  supine_doubt_point points[COVARIED];
  double covariance[9 * COVARIED * COVARIED];
  char text[160];
} work;

/* End the test; cmocka's assertions work only in the thread of the test. */
static void expect_ok(supine_status status) {
  if (status != SUPINE_OK) {
    (void)fprintf(stderr, "%s\n", supine_status_string(status));
    abort();
  }
}

static void use_poses(work *w) {
  static const double gravity[3] = {0, -1, 0.1};
  supine_basis *basis = w->basis;
  expect_ok(supine_state_parse("supine+15:rest+300", &w->state, &w->error));
  (void)supine_state_print(&w->state, w->text, sizeof w->text);
  (void)supine_state_describe(&w->state, w->text, sizeof w->text);
  (void)supine_posture_nearest("pron");
  expect_ok(supine_basis_weights(basis, gravity, w->numbers));
  expect_ok(supine_basis_pose(basis, &w->state, &w->pose, &w->error));
  expect_ok(supine_state_parse("prone:rest+100", &w->state, &w->error));
  expect_ok(supine_basis_pose(basis, &w->state, &w->other, &w->error));
  expect_ok(supine_basis_volumes(basis, &w->pose, w->numbers));
  (void)supine_basis_error(basis, &w->pose);
  const supine_pv_breath breath = supine_breath_default();
  (void)supine_breath_evaluate(supine_breath_normal(), &breath, 2, (const double[]){0.4, 3},
                               w->numbers, w->numbers + 2, &w->error);
}

static void use_positions(work *w) {
  supine_basis *basis = w->basis;
  float *xyz = w->xyz;
  float *second = w->second;
  const size_t n = VERTICES;
  expect_ok(supine_deform(basis, &w->pose, xyz));
  expect_ok(supine_deform_range(basis, &w->pose, 3, n - 1, xyz));
  expect_ok(supine_deform_strided(basis, &w->pose, 0, n, 12, xyz));
  expect_ok(supine_deform_batch(basis, 1, &w->pose, 0, n, xyz));
  expect_ok(supine_displace_range(basis, &w->pose, 0, n, second));
  supine_step(n, second, xyz);
  supine_normals(basis, xyz, second);
  /* These need normals, modes or clusters in the file, which not every basis has. */
  (void)supine_deform_lit(basis, &w->pose, xyz, second);
  (void)supine_gl_pack(basis, 0, n, xyz);
  (void)supine_gl_weights(basis, &w->pose, xyz, xyz + n);
  (void)supine_gl_pack_clusters(basis, 0, n, w->clustered);
  (void)supine_gl_frames(basis, &w->pose, w->frames);
  (void)supine_gl_pack_normals(basis, 0, n, (uint32_t *)(void *)xyz);
  (void)supine_gl_normal_weights(basis, &w->pose, xyz);
}

static void use_comparison(work *w) {
  supine_compare *compare = NULL;
  expect_ok(supine_compare_create(w->basis, &compare, &w->error));
  expect_ok(supine_compare_distances(compare, &w->pose, &w->other, w->distance));
  supine_compare_statistics(compare, w->distance, &w->statistics);
  supine_compare_energy(compare, w->energy);
  supine_compare_destroy(compare);
  expect_ok(supine_deform(w->basis, &w->pose, w->xyz));
  expect_ok(
      supine_compare_slabs(w->basis, w->state.gravity, NULL, w->xyz, SLABS, w->slabs, &w->error));
}

static void use_location(work *w) {
  const supine_location *found = NULL;
  expect_ok(supine_expected_error(w->basis, &w->state, NULL, w->distance, &w->error));
  expect_ok(supine_expected_parts(w->basis, &w->state, NULL, w->parts, &w->error));
  expect_ok(supine_deform(w->basis, &w->pose, w->xyz));
  for (size_t j = 0; j < SEEN; ++j) {
    const size_t at = j * VERTICES / SEEN;
    const float *x = w->xyz + 3 * at;
    w->seen[j] = (supine_observation){
        .vertex = at, .position = {(double)x[0], (double)x[1], (double)x[2]}, .noise = 1};
  }
  const supine_locate_task task = {
      .inside = w->basis, .count = SEEN, .observed = w->seen, .state = w->state, .rigid = true};
  expect_ok(supine_locate(&task, w->residuals, w->space, &found, &w->error));
  expect_ok(supine_locate_positions(found, w->basis, w->xyz, w->distance, &w->error));
  const supine_doubt_task field = {.basis = w->basis, .state_count = 1, .location = found};
  const supine_doubt *doubt = NULL;
  const supine_doubt_mend *mend = NULL;
  expect_ok(supine_doubt_prepare(&field, w->doubt_space, &doubt, &w->error));
  expect_ok(supine_doubt_sample(doubt, 0, 1, 2, w->xyz, &w->error));
  expect_ok(supine_doubt_mend_prepare(doubt, 0, w->mend_space, &mend, &w->error));
  expect_ok(supine_doubt_mend_sample(mend, w->xyz, &w->error));
  for (size_t i = 0; i < COVARIED; ++i) {
    w->points[i].vertex = i * VERTICES / COVARIED;
  }
  expect_ok(supine_doubt_covariance(doubt, COVARIED, w->points, NULL, w->covariance, &w->error));
}

static void use_all(work *w) {
  use_poses(w);
  use_positions(w);
  use_comparison(w);
  use_location(w);
}

static void use_normals(work *w) {
  memset(&w->pose, 0, sizeof w->pose);
  w->pose.weights[0] = 0.3;
  supine_pose_fill(&w->pose, 0.5);
  expect_ok(supine_deform_lit(w->basis, &w->pose, w->xyz, w->second));
  use_positions(w);
}

/* Open the basis, use it and close it, all in the thread. */
static void *run(void *context) {
  work *w = context;
  expect_ok(supine_basis_open_memory(w->bytes, w->size, &w->basis, &w->error));
  w->use(w);
  supine_basis_close(w->basis);
  return NULL;
}

/* Run `use` in a thread with the stated stack, and assert that no byte below the stack changes. */
static void expect_small_stack(fixture *f, void (*use)(work *w)) {
  work *w = fixture_allocate(1, sizeof *w);
  pthread_attr_t attributes;
  pthread_t thread;
  w->bytes = fixture_bytes(f, &w->size);
  w->space = fixture_allocate(supine_locate_space(SEEN), sizeof *w->space);
  w->doubt_space = fixture_allocate(1 << 16, sizeof *w->doubt_space);
  w->mend_space = fixture_allocate(1 << 20, sizeof *w->mend_space);
  w->use = use;
  unsigned char *memory =
      mmap(NULL, BELOW + STATED, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  assert_true(memory != MAP_FAILED);
  memset(memory, PAINT, BELOW + STATED);
  assert_int_equal(pthread_attr_init(&attributes), 0);
  assert_int_equal(pthread_attr_setstack(&attributes, memory + BELOW, STATED), 0);
  assert_int_equal(pthread_create(&thread, &attributes, run, w), 0);
  assert_int_equal(pthread_join(thread, NULL), 0);
  size_t unused = 0;
  while (unused < BELOW + STATED && memory[unused] == PAINT) {
    ++unused;
  }
  const size_t used = BELOW + STATED - unused;
  print_message("stack used: %zu kB\n", used >> 10);
  assert_in_range(used, 1 << 10, STATED);
  (void)pthread_attr_destroy(&attributes);
  (void)munmap(memory, BELOW + STATED);
  free(w->doubt_space);
  free(w->mend_space);
  free(w->space);
  free(w->bytes);
  free(w);
  fixture_destroy(f);
}

TEST(test_all_functions_stated_stack_suffices) {
  fixture *f = fixture_create_shrinking(VERTICES, 2, 77);
  f->resting = fixture_resting;
  expect_small_stack(f, use_all);
}

TEST(test_normals_stated_stack_suffices) {
  fixture *f = fixture_create(VERTICES, 16, 6, 2, false, true, 5, 9);
  fixture_add_normals(f, 6, 4);
  expect_small_stack(f, use_normals);
}

TEST(test_clusters_stated_stack_suffices) {
  fixture *f = fixture_create(VERTICES, 16, 6, 2, true, true, 5, 9);
  fixture_add_clusters(f, 9, 5, 4);
  fixture_add_normals(f, 6, 4);
  expect_small_stack(f, use_normals);
}
