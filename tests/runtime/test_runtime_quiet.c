/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The library calls memory and file functions only while it opens or closes a basis, and reports
 * each failing allocation. The linker option --wrap redirects the calls to this file. */
#include <sys/types.h>

#include "tests/helpers/test.h"

#include <supine/breath.h>
#include <supine/posture.h>
#include <supine/runtime.h>

#include "tests/helpers/runtime_fixture.h"

#include "tests/helpers/poses.h"

static size_t calls;    /* calls of the functions that the linker wraps */
static size_t live;     /* blocks allocated and not yet freed */
static size_t fail_at;  /* number of the allocation to refuse, from 1; 0: none */
static size_t attempts; /* allocations so far */
static bool counting;

static bool refuse(void) {
  calls += counting;
  attempts += counting;
  return counting && attempts == fail_at;
}

/* NOLINTBEGIN(bugprone-reserved-identifier,cert-dcl37-c,cert-dcl51-cpp): names for ld --wrap */
void *__real_malloc(size_t size);
void *__real_calloc(size_t count, size_t size);
void *__real_realloc(void *old, size_t size);
void *__real_aligned_alloc(size_t alignment, size_t size);
char *__real_strdup(const char *text);
void __real_free(void *block);
void *__real_mmap(void *address, size_t size, int protection, int flags, int file, off_t offset);
int __real_munmap(void *address, size_t size);
int __real_open(const char *path, int flags, ...);
int __real_close(int file);

void *__wrap_malloc(size_t size);
void *__wrap_calloc(size_t count, size_t size);
void *__wrap_realloc(void *old, size_t size);
void *__wrap_aligned_alloc(size_t alignment, size_t size);
char *__wrap_strdup(const char *text);
void __wrap_free(void *block);
void *__wrap_mmap(void *address, size_t size, int protection, int flags, int file, off_t offset);
int __wrap_munmap(void *address, size_t size);
int __wrap_open(const char *path, int flags);
int __wrap_close(int file);

static void *count_block(void *block) {
  live += counting && block != NULL;
  return block;
}

void *__wrap_malloc(size_t size) {
  return refuse() ? NULL : count_block(__real_malloc(size));
}
void *__wrap_calloc(size_t count, size_t size) {
  return refuse() ? NULL : count_block(__real_calloc(count, size));
}
void *__wrap_realloc(void *old, size_t size) {
  if (refuse()) {
    return NULL;
  }
  void *block = __real_realloc(old, size);
  live += counting && old == NULL && block != NULL;
  return block;
}
void *__wrap_aligned_alloc(size_t alignment, size_t size) {
  return refuse() ? NULL : count_block(__real_aligned_alloc(alignment, size));
}
char *__wrap_strdup(const char *text) {
  return refuse() ? NULL : count_block(__real_strdup(text));
}
void __wrap_free(void *block) {
  calls += counting;
  live -= counting && block != NULL;
  __real_free(block);
}
void *__wrap_mmap(void *address, size_t size, int protection, int flags, int file, off_t offset) {
  calls += counting;
  return count_block(__real_mmap(address, size, protection, flags, file, offset));
}
int __wrap_munmap(void *address, size_t size) {
  calls += counting;
  live -= counting;
  return __real_munmap(address, size);
}
int __wrap_open(const char *path, int flags) {
  calls += counting;
  live += counting;
  return __real_open(path, flags);
}
int __wrap_close(int file) {
  calls += counting;
  live -= counting;
  return __real_close(file);
}
/* NOLINTEND(bugprone-reserved-identifier,cert-dcl37-c,cert-dcl51-cpp) */

/* Call every function that takes an open basis. */
static void use_all(const supine_basis *basis, float *xyz) {
  double gravity[3];
  double weights[SUPINE_MODES_MAX];
  double scales[SUPINE_LUNGS_MAX];
  supine_error error;
  const size_t n = supine_basis_get_info(basis)->vertex_count;
  (void)supine_posture_gravity("prone", gravity);
  (void)supine_posture_tilt(gravity, 15, gravity);
  (void)supine_posture_nearest("pron");
  (void)supine_basis_weights(basis, gravity, weights);
  supine_state state = supine_basis_scan(basis);
  supine_pose pose;
  char text[160];
  (void)supine_state_parse("left:rest+500", &state, &error);
  (void)supine_state_parse("500", &state, &error);
  (void)supine_state_parse("left=scan+3,right=scan", &state, &error);
  (void)supine_state_print(&state, text, sizeof text);
  (void)supine_state_describe(&state, text, sizeof text);
  (void)supine_basis_pose(basis, &state, &pose, &error);
  state = supine_basis_scan(basis);
  /* 3 mL can be added, 3e9 mL cannot. */
  for (state.volume.ml = 3; state.volume.ml < 1e10; state.volume.ml *= 1e9) {
    if (supine_basis_pose(basis, &state, &pose, &error) == SUPINE_OK &&
        supine_basis_get_info(basis)->has_volume) {
      supine_basis_volumes(basis, &pose, scales);
    }
  }
  for (size_t i = 0; i < SUPINE_LUNGS_MAX; ++i) {
    scales[i] = 0.5;
  }
  (void)supine_basis_error(basis, POSED(basis, weights, scales));
  const supine_pv_breath breath = supine_breath_default();
  (void)supine_breath_evaluate(supine_breath_normal(), &breath, 2, (const double[]){0.4, 3},
                               weights, scales, &error);
  (void)supine_basis_weights(basis, gravity, weights);
  scales[0] = scales[1] = 0.5;
  supine_deform(basis, POSED(basis, weights, scales), xyz);
  supine_deform_range(basis, POSED(basis, weights, scales), 3, n - 1, xyz);
  supine_displace_range(basis, POSED(basis, weights, scales), 0, n, xyz + 3 * n);
  supine_deform_batch(basis, 1, posed_batch(basis, 1, weights, scales), 0, n, xyz);
  supine_step(n, xyz + 3 * n, xyz);
  supine_normals(basis, xyz, xyz + 3 * n);
  (void)supine_deform_lit(basis, POSED(basis, weights, scales), xyz, xyz + 3 * n);
  (void)supine_gl_pack(basis, 0, n, xyz);
  (void)supine_gl_weights(basis, POSED(basis, weights, scales), xyz, xyz + n);
  (void)supine_gl_pack_clusters(basis, 0, n, NULL); /* writes nothing, as there are no clusters */
  (void)supine_gl_frames(basis, POSED(basis, weights, scales), NULL);
  (void)supine_gl_pack_normals(basis, 0, n, (uint32_t *)(void *)xyz);
  (void)supine_gl_normal_weights(basis, POSED(basis, weights, scales), xyz);
  (void)supine_basis_metadata(basis, "kind");
  (void)supine_basis_vertices(basis);
  (void)supine_basis_triangles(basis);
}

typedef struct setting {
  fixture *f;
  char *folder;
  char path[128];
  float *xyz;
} setting;

static setting setting_open(void) {
  setting s = {.f = fixture_create(100, 5, 2, 2, false, true, 5, 9), .folder = fixture_folder()};
  (void)snprintf(s.path, sizeof s.path, "%s/a", s.folder);
  fixture_add_normals(s.f, 6, 4);
  fixture_write(s.f, s.path);
  s.xyz = calloc(100 * (SUPINE_GL_FLOATS + 5), sizeof *s.xyz);
  assert_non_null(s.xyz);
  return s;
}

static void setting_close(setting *s) {
  free(s->xyz);
  fixture_destroy(s->f);
  fixture_folder_remove(s->folder);
}

TEST(test_evaluate_open_basis_no_system_calls) {
  setting s = setting_open();
  supine_basis *basis = NULL;
  calls = live = attempts = fail_at = 0;
  counting = true;
  const supine_status status = supine_basis_open(s.path, &basis, NULL);
  const size_t opening = calls;
  if (status == SUPINE_OK) {
    use_all(basis, s.xyz);
  }
  const size_t using = calls - opening;
  supine_basis_close(basis);
  counting = false;
  assert_int_equal(status, SUPINE_OK);
  assert_true(opening > 5); /* opening allocates and reads, so calls are counted */
  assert_int_equal(using, 0);
  assert_int_equal(live, 0);
  setting_close(&s);
}

/* Memory of an allocator that the test passes to the library. */
typedef struct pool {
  size_t blocks, requests, refused; /* refused: number of the request to refuse, from 1; 0: none */
} pool;

static void *pool_allocate(void *user, size_t bytes) {
  pool *p = user;
  void *block =
      ++p->requests == p->refused ? NULL : __real_aligned_alloc(64, (bytes + 63) / 64 * 64);
  p->blocks += block != NULL;
  if (block != NULL) {
    memset(block, 0xA5, bytes);
  }
  return block;
}

static void pool_release(void *user, void *memory) {
  pool *p = user;
  assert_non_null(memory);
  --p->blocks;
  __real_free(memory);
}

TEST(test_open_with_allocator_uses_only_it) {
  setting s = setting_open();
  pool p = {0};
  supine_status status = SUPINE_ERROR_MEMORY;
  const supine_basis_options options = {.size = sizeof options,
                                        .allocator = {pool_allocate, pool_release, &p}};
  for (p.refused = 1; status != SUPINE_OK && p.refused < 1000; ++p.refused) {
    supine_basis *basis = NULL;
    supine_basis *usual = NULL;
    supine_error error = {0};
    attempts = p.requests = 0;
    counting = true;
    status = supine_basis_open_with(s.path, &options, &basis, &error);
    counting = false;
    assert_int_equal(attempts, 0); /* nothing is allocated by the C library */
    if (status != SUPINE_OK) {
      assert_int_equal(status, SUPINE_ERROR_MEMORY);
      assert_says(error.message, s.path);
    } else {
      float *xyz = s.xyz + 300;
      assert_in_range(p.blocks, 5, p.requests - 1); /* work space is freed */
      assert_int_equal(supine_basis_open(s.path, &usual, NULL), SUPINE_OK);
      const supine_pose pose = {.weights = {0.3, -0.2, 0.1}, .gains = {{1, 1, 1}, {1, 1, 1}}};
      supine_deform(basis, &pose, s.xyz);
      supine_deform(usual, &pose, xyz);
      assert_memory_equal(s.xyz, xyz, 300 * sizeof *xyz);
    }
    supine_basis_close(basis);
    supine_basis_close(usual);
    assert_int_equal(p.blocks, 0);
  }
  assert_int_equal(status, SUPINE_OK);
  assert_true(p.refused > 5);
  setting_close(&s);
}

TEST(test_open_with_half_an_allocator_refused) {
  setting s = setting_open();
  supine_basis *basis = NULL;
  const supine_basis_options options = {.size = sizeof options,
                                        .allocator = {.release = pool_release}};
  assert_int_equal(supine_basis_open_with(s.path, &options, &basis, NULL), SUPINE_ERROR_ARGUMENT);
  assert_null(basis);
  setting_close(&s);
}

TEST(test_open_each_allocation_failing_reports_memory_error) {
  setting s = setting_open();
  supine_status status = SUPINE_ERROR_MEMORY;
  size_t failures = 0;
  for (fail_at = 1; status != SUPINE_OK && fail_at < 1000; ++fail_at) {
    supine_basis *basis = NULL;
    supine_error error = {0};
    calls = live = attempts = 0;
    counting = true;
    status = supine_basis_open(s.path, &basis, &error);
    supine_basis_close(basis);
    counting = false;
    assert_int_equal(live, 0);
    if (status != SUPINE_OK) {
      assert_int_equal(status, SUPINE_ERROR_MEMORY);
      assert_says(error.message, s.path);
      ++failures;
    }
  }
  fail_at = 0;
  assert_int_equal(status, SUPINE_OK);
  assert_true(failures > 5);
  setting_close(&s);
}
