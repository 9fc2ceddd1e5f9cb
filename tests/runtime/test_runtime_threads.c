/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Several threads use one basis: each in an orientation of its own, and all together in an
 * orientation that they share. */
#include <pthread.h>

#include "tests/helpers/test.h"

#include <supine/runtime.h>

#include "tests/helpers/runtime_fixture.h"

#include "tests/helpers/poses.h"

enum { THREADS = 4, VERTICES = 1003 };

typedef struct job {
  const supine_basis *basis;
  size_t number;
  /* [N, 3] positions for one direction of gravity; each thread writes a range of the vertices */
  float *shared;
  float own[3 * VERTICES];       /* positions for a direction of gravity of its own */
  float batch[3 * 2 * VERTICES]; /* positions as in `shared`, then as in `own` */
} job;

static void frame(const supine_basis *basis, size_t number, double *weights, double *scales) {
  const double gravity[3] = {0.3 + (double)number, -0.7, 0.1 * (double)number};
  (void)supine_basis_weights(basis, gravity, weights);
  scales[0] = 0.7;
  scales[1] = 0.2 * (double)number;
}

static void *work(void *context) {
  job *j = context;
  double weights[2][7];
  double scales[2][2];
  frame(j->basis, 0, weights[0], scales[0]);
  frame(j->basis, j->number, weights[1], scales[1]);
  const size_t begin = VERTICES * j->number / THREADS;
  const size_t end = VERTICES * (j->number + 1) / THREADS;
  for (int i = 0; i < 50; ++i) {
    supine_deform_range(j->basis, POSED(j->basis, weights[0], scales[0]), begin, end,
                        j->shared + 3 * begin);
    supine_deform(j->basis, POSED(j->basis, weights[1], scales[1]), j->own);
    supine_deform_batch(j->basis, 2, posed_batch(j->basis, 2, weights[0], scales[0]), 0, VERTICES,
                        j->batch);
    supine_normals(j->basis, j->own, j->batch);
  }
  return NULL;
}

TEST(test_basis_many_threads_same_bits) {
  fixture *f = fixture_create(VERTICES, 7, 2, 2, false, false, 9, 21);
  size_t size = 0;
  unsigned char *bytes = fixture_bytes(f, &size);
  supine_basis *basis = NULL;
  assert_int_equal(supine_basis_open_memory(bytes, size, &basis, NULL), SUPINE_OK);
  float *shared = fixture_allocate((size_t)3 * VERTICES, sizeof *shared);
  float *alone = fixture_allocate((size_t)3 * VERTICES, sizeof *alone);
  job *jobs = fixture_allocate(THREADS, sizeof *jobs);
  pthread_t threads[THREADS];
  for (size_t i = 0; i < THREADS; ++i) {
    jobs[i].basis = basis;
    jobs[i].number = i;
    jobs[i].shared = shared;
    assert_int_equal(pthread_create(&threads[i], NULL, work, &jobs[i]), 0);
  }
  for (size_t i = 0; i < THREADS; ++i) {
    assert_int_equal(pthread_join(threads[i], NULL), 0);
  }
  double weights[7];
  double scales[2];
  frame(basis, 0, weights, scales);
  supine_deform(basis, POSED(basis, weights, scales), alone);
  assert_memory_equal(shared, alone, 3 * VERTICES * sizeof *alone);
  for (size_t i = 0; i < THREADS; ++i) {
    frame(basis, i, weights, scales);
    supine_deform(basis, POSED(basis, weights, scales), alone);
    assert_memory_equal(jobs[i].own, alone, 3 * VERTICES * sizeof *alone);
  }
  free(shared);
  free(alone);
  free(jobs);
  supine_basis_close(basis);
  free(bytes);
  fixture_destroy(f);
}
