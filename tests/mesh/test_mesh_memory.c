/* SPDX-License-Identifier: GPL-3.0-or-later */
/* If any allocation fails while a mesh is loaded, measured or saved, the function reports an error
 * or does without the memory. A leak sanitizer checks that nothing leaks. The linker option --wrap
 * redirects allocations to this file. */
#include <errno.h>
#include <sys/mman.h>

#include "tests/helpers/mesh_samples.h"

/* number of allocations that still succeed before one fails; negative if none shall fail */
static int allocations_left = -1;
/* number of failed allocations, in memory shared with the process in which assimp runs */
static int *allocations_failed;

static int allocation_fails(void) {
  const int fails = allocations_left >= 0 && allocations_left-- == 0;
  if (fails) {
    ++*allocations_failed;
    errno = ENOMEM;
  }
  return fails;
}

/* NOLINTBEGIN(bugprone-reserved-identifier,cert-dcl37-c,cert-dcl51-cpp): names for ld --wrap */
void *__real_malloc(size_t size);
void *__real_calloc(size_t count, size_t size);
void *__real_realloc(void *old, size_t size);
void *__wrap_malloc(size_t size);
void *__wrap_calloc(size_t count, size_t size);
void *__wrap_realloc(void *old, size_t size);

void *__wrap_malloc(size_t size) {
  return allocation_fails() ? NULL : __real_malloc(size);
}

void *__wrap_calloc(size_t count, size_t size) {
  return allocation_fails() ? NULL : __real_calloc(count, size);
}

void *__wrap_realloc(void *old, size_t size) {
  return allocation_fails() ? NULL : __real_realloc(old, size);
}
/* NOLINTEND(bugprone-reserved-identifier,cert-dcl37-c,cert-dcl51-cpp) */

/* Call `work` repeatedly. Let the first allocation fail in the first call, the second in the second
 * call, and so on. Stop when a call makes too few allocations for one to fail, and assert that it
 * made at least `least`. */
static void fail_each(supine_status (*work)(const char *path, supine_error *error),
                      const char *path, int least) {
  for (int nth = 0;; ++nth) {
    supine_error error = {0};
    allocations_left = nth;
    *allocations_failed = 0;
    const supine_status status = work(path, &error);
    allocations_left = -1;
    const bool was_last = *allocations_failed == 0;
    if (was_last) {
      assert_int_equal(status, SUPINE_OK);
      if (nth < least) {
        fail_msg("%s: only %d allocations", path, nth);
      }
      return;
    }
    if (status == SUPINE_OK) {
      continue; /* the memory was optional, such as a buffer */
    }
    /* Without memory, opening an output gives a write error, and the message names memory. */
    if ((status != SUPINE_ERROR_MEMORY && status != SUPINE_ERROR_WRITE) || error.status != status ||
        strstr(error.message, "memory") == NULL) {
      fail_msg("%s: allocation %d: status %d, \"%s\"", path, nth, (int)status, error.message);
    }
  }
}

static supine_status load(const char *path, supine_error *error) {
  supine_mesh mesh = {0};
  const supine_status status = supine_mesh_load(path, NULL, &mesh, NULL, error);
  assert_true((status == SUPINE_OK) == (mesh.vertices != NULL));
  assert_int_equal(mesh.triangle_count, status == SUPINE_OK ? 2 : 0);
  supine_mesh_free(&mesh);
  return status;
}

TEST(test_load_each_allocation_failing_reports_memory_error) {
  static const struct {
    const char *name;
    const char *text;
  } files[] = {{"a.ply",
                "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
                "property float z\nproperty float a\nelement face 1\nproperty list uchar int "
                "vertex_indices\nend_header\n0 0 0 1\n1 0 0 2\n1 1 0 3\n0 1 0 4\n4 0 1 2 3\n"},
               {"a.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n"}};
  for (size_t i = 0; i < sizeof files / sizeof *files; ++i) {
    char path[256];
    (void)sample_text(state, files[i].name, files[i].text, path);
    /* 5 allocations: arrays of bytes, vertices and triangles, and two arrays to merge vertices. */
    fail_each(load, path, 5);
    assert_int_equal(unlink(path), 0);
  }
}

static supine_status find_edges(const char *path, supine_error *error) {
  supine_mesh mesh = {0};
  supine_topology topology = {0};
  const int left = allocations_left;
  allocations_left = -1;
  assert_int_equal(supine_mesh_load(path, NULL, &mesh, NULL, NULL), SUPINE_OK);
  allocations_left = left;
  const supine_status status = supine_mesh_topology_create(&mesh, &topology);
  allocations_left = -1;
  assert_true((status == SUPINE_OK) == (topology.edges != NULL));
  assert_true((status == SUPINE_OK) == (topology.component != NULL));
  supine_mesh_topology_free(&topology);
  supine_mesh_free(&mesh);
  /* supine_mesh_topology_create sets no message. */
  return supine_error_set(error, status, "out of memory");
}

TEST(test_topology_each_allocation_failing_reports_memory_error) {
  char path[256];
  (void)sample_text(state, "a.ply", SAMPLE_PLY(4, 1) "0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n",
                    path);
  fail_each(find_edges, path, 4);
  assert_int_equal(unlink(path), 0);
}

static supine_status save(const char *path, supine_error *error) {
  double vertices[] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  uint32_t triangles[] = {0, 1, 2};
  const supine_mesh mesh = {3, vertices, 1, triangles};
  const supine_mesh_save_options options = {.from = vertices, .comment = "a triangle"};
  const supine_status status = supine_mesh_save(path, &mesh, &options, error);
  assert_int_equal(unlink(path), status == SUPINE_OK ? 0 : -1);
  return status;
}

/* Only opening an output allocates memory. If a file were left behind, removing the
 * folder at the end would fail. */
TEST(test_save_each_allocation_failing_reports_memory_error) {
  static const char *const names[] = {"a.ply", "a.obj", "a.stl", "a.vtp"};
  for (size_t i = 0; i < sizeof names / sizeof *names; ++i) {
    char path[256];
    fail_each(save, sample_path(state, names[i], path), 0);
  }
}

static int setup(void **state) {
  allocations_failed = mmap(NULL, sizeof *allocations_failed, PROT_READ | PROT_WRITE,
                            MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  return allocations_failed == MAP_FAILED ? -1 : sample_folder_create(state);
}

TEST_GROUP(setup, sample_folder_remove)
