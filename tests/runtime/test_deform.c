/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compare positions with those in double precision, for every storage format and instruction
 * set. */
#include "tests/helpers/test.h"

#include <supine/compare.h>
#include <supine/runtime.h>

#include "tests/helpers/runtime_fixture.h"

#include "tests/helpers/poses.h"

/* A synthetic basis, and the bytes of its file. */
typedef struct opened {
  fixture *f;
  unsigned char *bytes;
  size_t size;
} opened;

static opened made(fixture *f) {
  opened o = {f, NULL, 0};
  o.bytes = fixture_bytes(f, &o.size);
  return o;
}

static void drop(opened *o) {
  free(o->bytes);
  fixture_destroy(o->f);
}

static supine_basis *open_as(const opened *o, supine_storage storage, supine_simd simd) {
  return fixture_open(o->bytes, o->size, storage, simd);
}

static void random_frame(const supine_basis *basis, uint64_t *random, double *weights,
                         double *scales) {
  const double gravity[3] = {fixture_random(random), fixture_random(random),
                             fixture_random(random)};
  assert_int_equal(supine_basis_weights(basis, gravity, weights), SUPINE_OK);
  for (size_t i = 0; i < SUPINE_LUNGS_MAX; ++i) {
    scales[i] = 2 * fixture_random(random);
  }
}

/* Return the largest distance, mm, of the vertices begin <= i < end in `xyz` from their positions
 * in `exact`. `xyz` holds only these vertices, `exact` holds all. */
static double farthest(const float *xyz, const double *exact, size_t begin, size_t end) {
  double top = 0;
  for (size_t i = begin; i < end; ++i) {
    double square = 0;
    for (size_t axis = 0; axis < 3; ++axis) {
      const double apart = (double)xyz[3 * (i - begin) + axis] - exact[3 * i + axis];
      square += apart * apart;
    }
    assert_true(square >= 0); /* fails for NaN */
    top = square > top ? square : top;
  }
  return sqrt(top);
}

/* Assert that positions err by at most supine_basis_error. */
static void check_all_paths(size_t vertices, size_t modes, size_t lungs, bool vector,
                            uint64_t seed) {
  opened o = made(fixture_create(vertices, modes, 3, lungs, vector, false, 11, seed));
  double *exact = fixture_allocate(3 * vertices, sizeof *exact);
  float *xyz = fixture_allocate(3 * vertices, sizeof *xyz);
  uint64_t random = seed;
  for (int storage = 0; storage < SUPINE_STORAGE_COUNT; ++storage) {
    for (int simd = 0; simd < SUPINE_SIMD_COUNT; ++simd) {
      supine_basis *basis = open_as(&o, (supine_storage)storage, (supine_simd)simd);
      if (basis == NULL) {
        continue;
      }
      double weights[SUPINE_MODES_MAX];
      double scales[SUPINE_LUNGS_MAX];
      random_frame(basis, &random, weights, scales);
      fixture_deform(o.f, weights, scales, exact);
      supine_deform(basis, POSED(basis, weights, scales), xyz);
      const double error = farthest(xyz, exact, 0, vertices);
      if (!(error <= supine_basis_error(basis, POSED(basis, weights, scales)))) {
        fail_msg(
            "%zu vertices, %zu modes, %zu lungs, storage %d, instruction set %d: positions err by "
            "%g mm, more than the bound of %g mm",
            vertices, modes, lungs, storage, simd, error,
            supine_basis_error(basis, POSED(basis, weights, scales)));
      }
      supine_basis_close(basis);
    }
  }
  free(exact);
  free(xyz);
  drop(&o);
}

TEST(test_deform_every_path_within_stated_error) {
  static const size_t sizes[] = {1, 2, 15, 16, 17, 31, 33, 48, 100, 257};
  static const size_t modes[] = {1, 2, 3, 4, 5, 7, 8, 15, 16, 17, 33, 64};
  for (size_t i = 0; i < sizeof sizes / sizeof *sizes; ++i) {
    for (size_t j = 0; j < sizeof modes / sizeof *modes; ++j) {
      const size_t lungs = sizes[i] < 3 ? 1 : 1 + (i + j) % 3;
      check_all_paths(sizes[i], modes[j], lungs, false, 100 * i + j);
      if (j % 2 == i % 2) {
        check_all_paths(sizes[i], modes[j], lungs, true, 7 + 100 * i + j);
      }
    }
  }
  check_all_paths(100, 255, 2, false, 1);
  check_all_paths(100, 256, 2, true, 2);
}

TEST(test_deform_every_mode_count_within_stated_error) {
  for (size_t modes = 1; modes <= 64; ++modes) {
    check_all_paths(21, modes, 1, modes % 3 == 0, modes);
  }
}

/* supine_basis_error is at most 30 times the largest error of 20 random poses. */
TEST(test_basis_error_many_frames_bound_at_most_30_times_error) {
  opened o = made(fixture_create(3000, 16, 3, 2, false, false, 11, 5));
  double *exact = fixture_allocate(3 * 3000, sizeof *exact);
  float *xyz = fixture_allocate(3 * 3000, sizeof *xyz);
  for (int storage = SUPINE_STORAGE_EXACT; storage < SUPINE_STORAGE_COUNT; ++storage) {
    supine_basis *basis = open_as(&o, (supine_storage)storage, SUPINE_SIMD_AUTO);
    uint64_t random = 31;
    double best = 0;
    for (int trial = 0; trial < 20; ++trial) {
      double weights[SUPINE_MODES_MAX];
      double scales[SUPINE_LUNGS_MAX];
      random_frame(basis, &random, weights, scales);
      fixture_deform(o.f, weights, scales, exact);
      supine_deform(basis, POSED(basis, weights, scales), xyz);
      const double ratio =
          farthest(xyz, exact, 0, 3000) / supine_basis_error(basis, POSED(basis, weights, scales));
      assert_true(ratio <= 1);
      best = ratio > best ? ratio : best;
    }
    assert_true(best > 1.0 / 30);
    supine_basis_close(basis);
  }
  free(exact);
  free(xyz);
  drop(&o);
}

/* The storage error is the same whether a weight depends on the x, the y or the z of gravity. */
TEST(test_storage_error_mode_along_any_axis_same) {
  double error[3];
  for (size_t axis = 0; axis < 3; ++axis) {
    fixture *f = fixture_create(500, 2, 1, 1, false, false, 11, 5);
    memset(f->mode, 0, 8 * sizeof *f->mode);
    f->mode[0] = 1;
    f->mode[4 + 1 + axis] = 3;
    for (size_t i = 0; i < f->vertices; ++i) {
      f->coefficient[2 * i] *= 0.01F;
    }
    opened o = made(f);
    supine_basis *basis = open_as(&o, SUPINE_STORAGE_INT16, SUPINE_SIMD_AUTO);
    error[axis] = supine_basis_get_info(basis)->storage_error;
    supine_basis_close(basis);
    drop(&o);
  }
  assert_true(fabs(error[1] - error[0]) <= 1e-9 * error[0]);
  assert_true(fabs(error[2] - error[0]) <= 1e-9 * error[0]);
}

TEST(test_storage_error_exact_below_int16_below_mixed) {
  opened o = made(fixture_create(500, 16, 3, 2, false, true, 11, 5));
  double error[SUPINE_STORAGE_COUNT] = {0};
  double bytes[SUPINE_STORAGE_COUNT] = {0};
  for (int storage = SUPINE_STORAGE_EXACT; storage < SUPINE_STORAGE_COUNT; ++storage) {
    supine_basis *basis = open_as(&o, (supine_storage)storage, SUPINE_SIMD_AUTO);
    const supine_basis_info *info = supine_basis_get_info(basis);
    assert_int_equal(info->storage, storage);
    assert_true(info->simd != SUPINE_SIMD_AUTO);
    error[storage] = info->storage_error;
    bytes[storage] = info->bytes_per_vertex;
    assert_true(error[storage] > 0);
    supine_basis_close(basis);
  }
  assert_true(error[SUPINE_STORAGE_EXACT] < error[SUPINE_STORAGE_INT16]);
  /* 4 bytes for each of the 16 coefficients, 12 for the position, 12 for the direction */
  assert_true(bytes[SUPINE_STORAGE_EXACT] == 88);
  /* 2 bytes for each of the 16 coefficients, 8 for the position, 8 for the direction */
  assert_true(bytes[SUPINE_STORAGE_INT16] == 48);
  assert_true(error[SUPINE_STORAGE_INT16] < error[SUPINE_STORAGE_MIXED]);
  /* seven 4-byte words for 16 coefficients, 8 bytes for the position, 8 for the direction */
  assert_true(bytes[SUPINE_STORAGE_MIXED] == 44);
  drop(&o);
}

/* If the last modes have small amplitudes, as in real lungs, they get fewer bits by default. */
TEST(test_storage_auto_small_last_modes_chooses_mixed) {
  fixture *f = fixture_create(500, 16, 3, 1, false, false, 11, 5);
  for (size_t i = 0; i < (size_t)500 * 16; ++i) {
    f->coefficient[i] *= i % 16 < 10 ? 1 : 0.02F;
  }
  opened o = made(f);
  supine_basis *basis = open_as(&o, SUPINE_STORAGE_AUTO, SUPINE_SIMD_AUTO);
  assert_int_equal(supine_basis_get_info(basis)->storage, SUPINE_STORAGE_MIXED);
  assert_true(supine_basis_get_info(basis)->storage_error <= 0.005);
  supine_basis_close(basis);
  drop(&o);
}

/* If coefficients and displacement directions are numbers just below 2^30, error bounds are finite.
 * A file with a coefficient of 2^30 is refused. */
TEST(test_storage_error_largest_numbers_finite) {
  fixture *f = fixture_create(50, 16, 3, 1, false, false, 11, 5);
  for (size_t i = 0; i < 3; ++i) { /* displacements of up to 600 m, near the limit of 1 km */
    f->direction[i] = 0x1p16F;
    f->coefficient[i] = 0.4F;
  }
  opened o = made(f);
  for (int storage = SUPINE_STORAGE_AUTO; storage < SUPINE_STORAGE_COUNT; ++storage) {
    supine_basis *basis = open_as(&o, (supine_storage)storage, SUPINE_SIMD_AUTO);
    assert_true(isfinite(supine_basis_get_info(basis)->storage_error));
    supine_basis_close(basis);
  }
  free(o.bytes);
  f->coefficient[1] = 8;
  supine_basis *basis = NULL;
  o.bytes = fixture_bytes(f, &o.size);
  assert_int_equal(supine_basis_open_memory(o.bytes, o.size, &basis, NULL), SUPINE_ERROR_FORMAT);
  drop(&o);
}

static void check_stated_error(const opened *o, const supine_basis *chosen) {
  const supine_basis_info *info = supine_basis_get_info(chosen);
  supine_basis *basis = open_as(o, info->storage, SUPINE_SIMD_AUTO);
  assert_true(supine_basis_get_info(basis)->storage_error == info->storage_error);
  supine_basis_close(basis);
}

TEST(test_storage_auto_distant_vertex_chooses_exact) {
  fixture *f = fixture_create(500, 16, 3, 1, false, false, 11, 5);
  opened o = made(f);
  supine_basis *basis = open_as(&o, SUPINE_STORAGE_AUTO, SUPINE_SIMD_AUTO);
  assert_int_equal(supine_basis_get_info(basis)->storage, SUPINE_STORAGE_INT16);
  assert_true(supine_basis_get_info(basis)->storage_error <= 0.005);
  check_stated_error(&o, basis);
  supine_basis_close(basis);
  free(o.bytes);
  f->vertex[0] = 1e6F; /* 1 km away, which makes 16-bit positions coarse */
  o = made(f);
  basis = open_as(&o, SUPINE_STORAGE_AUTO, SUPINE_SIMD_AUTO);
  assert_int_equal(supine_basis_get_info(basis)->storage, SUPINE_STORAGE_EXACT);
  check_stated_error(&o, basis);
  supine_basis_close(basis);
  drop(&o);
}

TEST(test_open_bad_options_refused) {
  opened o = made(fixture_create(5, 1, 0, 1, false, false, 1, 1));
  const supine_basis_options bad[] = {{sizeof *bad, .storage = SUPINE_STORAGE_COUNT},
                                      {sizeof *bad, .simd = SUPINE_SIMD_COUNT},
                                      {sizeof *bad, .storage = (supine_storage)-1},
                                      {.size = 0}};
  for (size_t i = 0; i < sizeof bad / sizeof *bad; ++i) {
    supine_basis *basis = NULL;
    assert_int_equal(supine_basis_open_memory_with(o.bytes, o.size, &bad[i], &basis, NULL),
                     SUPINE_ERROR_ARGUMENT);
    assert_null(basis);
  }
  drop(&o);
}

#if defined(__x86_64__)
/* Open a basis whose instruction set SUPINE_SIMD names. Return the status, and the set in use. */
static supine_status open_named(const opened *o, const char *name, supine_simd *simd) {
  const supine_basis_options options = {.size = sizeof options};
  supine_basis *basis = NULL;
  assert_int_equal(setenv("SUPINE_SIMD", name, 1), 0);
  const supine_status status =
      supine_basis_open_memory_with(o->bytes, o->size, &options, &basis, NULL);
  *simd = basis != NULL ? supine_basis_get_info(basis)->simd : SUPINE_SIMD_AUTO;
  supine_basis_close(basis);
  return status;
}

TEST(test_open_simd_of_environment_used_unknown_refused) {
  static const char *const names[SUPINE_SIMD_COUNT] = {[SUPINE_SIMD_PORTABLE] = "portable",
                                                       [SUPINE_SIMD_AVX2] = "avx2",
                                                       [SUPINE_SIMD_AVX512] = "avx512"};
  static const char *const wrong[] = {"", "sse", "avx", "avx2 "};
  opened o = made(fixture_create(50, 1, 0, 1, false, false, 1, 1));
  const char *before = getenv("SUPINE_SIMD");
  char *kept = before != NULL ? strdup(before) : NULL;
  for (int i = SUPINE_SIMD_PORTABLE; i < SUPINE_SIMD_COUNT; ++i) {
    supine_basis *chosen = open_as(&o, SUPINE_STORAGE_AUTO, (supine_simd)i);
    const bool there = chosen != NULL;
    supine_simd simd;
    supine_basis_close(chosen);
    assert_int_equal(open_named(&o, names[i], &simd), there ? SUPINE_OK : SUPINE_ERROR_UNSUPPORTED);
    assert_int_equal(simd, there ? i : SUPINE_SIMD_AUTO);
  }
  for (size_t i = 0; i < sizeof wrong / sizeof *wrong; ++i) {
    supine_simd simd;
    assert_int_equal(open_named(&o, wrong[i], &simd), SUPINE_ERROR_UNSUPPORTED);
  }
  assert_int_equal(kept != NULL ? setenv("SUPINE_SIMD", kept, 1) : unsetenv("SUPINE_SIMD"), 0);
  free(kept);
  drop(&o);
}
#endif

/* Assert that positions of any range of vertices, written at any alignment, have the same bits as
 * in one call for all vertices, and that nothing outside the range is written. */
static void check_ranges(size_t vertices, size_t modes, size_t lungs, supine_simd simd,
                         int trials) {
  opened o = made(fixture_create(vertices, modes, 1, lungs, false, false, 11, 8));
  supine_basis *basis = open_as(&o, SUPINE_STORAGE_INT16, simd);
  if (basis == NULL) {
    drop(&o);
    return;
  }
  const float mark = -12345.5F;
  float *whole = fixture_allocate(3 * vertices, sizeof *whole);
  float *part = fixture_allocate(3 * vertices + 64, sizeof *part);
  uint64_t random = 17;
  double weights[SUPINE_MODES_MAX];
  double scales[SUPINE_LUNGS_MAX];
  random_frame(basis, &random, weights, scales);
  supine_deform(basis, POSED(basis, weights, scales), whole);
  for (int trial = 0; trial < trials; ++trial) {
    const double a = (fixture_random(&random) + 1) / 2;
    const double b = (fixture_random(&random) + 1) / 2;
    size_t begin = (size_t)((double)vertices * (a < b ? a : b));
    size_t end = (size_t)((double)vertices * (a < b ? b : a)) + 1;
    if (trial % 5 == 0) {
      begin = 0;
      end = vertices;
    }
    const size_t count = end - begin;
    const size_t shift = (size_t)trial % 17;
    for (size_t i = 0; i < 3 * count + 64; ++i) {
      part[i] = mark;
    }
    supine_deform_range(basis, POSED(basis, weights, scales), begin, end, part + shift);
    assert_memory_equal(part + shift, whole + 3 * begin, 3 * count * sizeof *part);
    for (size_t i = 0; i < 64; ++i) {
      assert_true((i < shift ? part[i] : part[i + 3 * count]) == mark);
    }
  }
  supine_deform_range(basis, POSED(basis, weights, scales), 5, 5, NULL); /* an empty range */
  free(whole);
  free(part);
  supine_basis_close(basis);
  drop(&o);
}

TEST(test_deform_range_any_part_same_bits) {
  for (int simd = 1; simd < SUPINE_SIMD_COUNT; ++simd) {
    check_ranges(331, 5, 3, (supine_simd)simd, 300);
  }
}

TEST(test_deform_strided_interleaved_same_bits) {
  enum { VERTICES = 2500, STRIDE = 20 };
  opened o = made(fixture_create(VERTICES, 5, 1, 3, false, false, 11, 8));
  supine_basis *basis = open_as(&o, SUPINE_STORAGE_EXACT, SUPINE_SIMD_PORTABLE);
  static float whole[3 * VERTICES];
  static unsigned char buffer[VERTICES * STRIDE];
  uint64_t random = 23;
  double weights[SUPINE_MODES_MAX];
  double scales[SUPINE_LUNGS_MAX];
  random_frame(basis, &random, weights, scales);
  const supine_pose *pose = POSED(basis, weights, scales);
  supine_deform(basis, pose, whole);
  memset(buffer, 0x5a, sizeof buffer);
  assert_int_equal(supine_deform_strided(basis, pose, 7, VERTICES, STRIDE, buffer + 7 * STRIDE),
                   SUPINE_OK);
  for (size_t i = 0; i < VERTICES; ++i) {
    unsigned char kept[STRIDE];
    memset(kept, 0x5a, STRIDE);
    const unsigned char *at = buffer + i * STRIDE;
    assert_memory_equal(at, i < 7 ? (const void *)kept : (const void *)(whole + 3 * i),
                        3 * sizeof *whole);
    assert_memory_equal(at + 12, kept, STRIDE - 12);
  }
  assert_int_equal(supine_deform_strided(basis, pose, 0, 2, 11, buffer), SUPINE_ERROR_ARGUMENT);
  assert_int_equal(supine_deform_strided(basis, pose, 0, VERTICES + 1, STRIDE, buffer),
                   SUPINE_ERROR_ARGUMENT);
  supine_basis_close(basis);
  drop(&o);
}

TEST(test_deform_range_larger_than_cache_same_bits) {
  for (int simd = 1; simd < SUPINE_SIMD_COUNT; ++simd) {
    check_ranges(300007, 16, 2, (supine_simd)simd, 18);
  }
}

TEST(test_displace_range_added_to_reference_equals_deform) {
  for (int vector = 0; vector < 2; ++vector) {
    opened o = made(fixture_create(100, 7, 2, 2, vector != 0, false, 11, 8));
    for (int simd = 1; simd < SUPINE_SIMD_COUNT; ++simd) {
      supine_basis *basis = open_as(&o, SUPINE_STORAGE_EXACT, (supine_simd)simd);
      if (basis == NULL) {
        continue;
      }
      uint64_t random = 3;
      double weights[SUPINE_MODES_MAX];
      double scales[SUPINE_LUNGS_MAX];
      double exact[300];
      float moved[3 * 86];
      random_frame(basis, &random, weights, scales);
      fixture_deform(o.f, weights, scales, exact);
      supine_displace_range(basis, POSED(basis, weights, scales), 3, 89, moved);
      for (size_t i = 0; i < (size_t)3 * 86; ++i) {
        moved[i] += o.f->vertex[9 + i];
      }
      assert_true(farthest(moved, exact, 3, 89) <=
                  supine_basis_error(basis, POSED(basis, weights, scales)));
      supine_basis_close(basis);
    }
    drop(&o);
  }
}

TEST(test_step_many_steps_reach_final_positions) {
  opened o = made(fixture_create(100, 7, 2, 2, false, false, 11, 8));
  supine_basis *basis = open_as(&o, SUPINE_STORAGE_AUTO, SUPINE_SIMD_AUTO);
  uint64_t random = 5;
  double weights[SUPINE_MODES_MAX];
  double scales[SUPINE_LUNGS_MAX];
  double exact[300];
  float step[300];
  float xyz[300];
  random_frame(basis, &random, weights, scales);
  enum { STEPS = 60 };
  const double small[2] = {scales[0] / STEPS, scales[1] / STEPS};
  const double none[2] = {0, 0};
  supine_displace_range(basis, POSED(basis, weights, small), 0, 100, step);
  supine_deform(basis, POSED(basis, weights, none), xyz);
  for (int i = 0; i < STEPS; ++i) {
    supine_step(100, step, xyz);
  }
  fixture_deform(o.f, weights, scales, exact);
  /* Each step rounds three coordinates by at most 2^-24 of 512 mm. 1.8 exceeds sqrt(3). */
  const double drift = STEPS * 0x1p-24 * 512 * 1.8;
  assert_true(farthest(xyz, exact, 0, 100) <=
              supine_basis_error(basis, POSED(basis, weights, scales)) + drift);
  supine_basis_close(basis);
  drop(&o);
}

static void check_batch(size_t vertices, size_t modes, bool vector, size_t count, size_t begin,
                        size_t end) {
  opened o = made(fixture_create(vertices, modes, 2, 2, vector, false, 11, 8));
  double *weights = fixture_allocate(count * modes, sizeof *weights);
  double *scales = fixture_allocate(count * 2 + SUPINE_LUNGS_MAX, sizeof *scales);
  double *exact = fixture_allocate(3 * vertices, sizeof *exact);
  float *xyz = fixture_allocate(3 * count * (end - begin), sizeof *xyz);
  for (int storage = 1; storage < SUPINE_STORAGE_COUNT; ++storage) {
    for (int simd = 1; simd < SUPINE_SIMD_COUNT; ++simd) {
      supine_basis *basis = open_as(&o, (supine_storage)storage, (supine_simd)simd);
      if (basis == NULL) {
        continue;
      }
      uint64_t random = 77;
      for (size_t j = 0; j < count; ++j) {
        random_frame(basis, &random, weights + j * modes, scales + 2 * j);
      }
      for (size_t i = 0; i < 3 * count * (end - begin); ++i) {
        xyz[i] = 1e30F; /* a value that no evaluation writes */
      }
      supine_deform_batch(basis, count, posed_batch(basis, count, weights, scales), begin, end,
                          xyz);
      for (size_t j = 0; j < count; ++j) {
        fixture_deform(o.f, weights + j * modes, scales + 2 * j, exact);
        const double error = farthest(xyz + 3 * j * (end - begin), exact, begin, end);
        if (!(error <=
              supine_basis_error(basis, POSED(basis, weights + j * modes, scales + 2 * j)))) {
          fail_msg("orientation %zu, storage %d, instruction set %d: positions err by %g mm", j,
                   storage, simd, error);
        }
      }
      supine_basis_close(basis);
    }
  }
  free(weights);
  free(scales);
  free(exact);
  free(xyz);
  drop(&o);
}

TEST(test_deform_batch_each_orientation_within_stated_error) {
  check_batch(700, 16, false, 64, 0, 700);
  check_batch(700, 16, false, 1, 3, 691);
  check_batch(24000, 16, false, 64, 0, 24000); /* the output exceeds the cache */
  check_batch(23999, 16, false, 64, 1, 23998); /* from vertex 1: batch entries share cache lines */
  check_batch(90, 16, false, 300, 0, 90);
  check_batch(90, 3, false, 5, 17, 60);
  check_batch(90, 3, false, 5, 17, 18);
  check_batch(90, 5, true, 5, 0, 90);
  check_batch(90, 255, false, 18, 1, 90);
  check_batch(90, 256, true, 3, 1, 90);
}

/* A shader that reads coefficients from a texture takes weights of more modes than attributes
 * hold. */
TEST(test_gl_weights_many_modes_all_written) {
  enum { VERTICES = 20, MODES = 41, SLOTS = 44 };
  opened o = made(fixture_create(VERTICES, MODES, 1, 2, true, false, 3, 17));
  supine_basis *basis = open_as(&o, SUPINE_STORAGE_EXACT, SUPINE_SIMD_AUTO);
  float attributes[VERTICES * (SUPINE_GL_VECTOR_FLOATS + 3 * MODES)];
  float uniforms[SLOTS];
  float gains[6];
  double weights[MODES];
  const double scales[2] = {1.25, 0.75};
  for (size_t k = 0; k < MODES; ++k) {
    weights[k] = 0.5 * (double)k - 7.25;
  }
  assert_int_equal(supine_gl_pack(basis, 0, VERTICES, attributes), SUPINE_ERROR_UNSUPPORTED);
  assert_int_equal(supine_gl_weights(basis, POSED(basis, weights, scales), uniforms, gains),
                   SUPINE_OK);
  for (size_t k = 0; k < SLOTS; ++k) {
    assert_true(uniforms[k] == (k < MODES ? (float)weights[k] : 0.0F));
  }
  supine_basis_close(basis);
  drop(&o);
}

/* Five weights leave three components of two vec4s unused; these are set to 0. */
TEST(test_gl_weights_unused_slots_zero) {
  enum { VERTICES = 40, MODES = 5, SLOTS = 8, FLOATS = SUPINE_GL_FLOATS + MODES };
  opened o = made(fixture_create(VERTICES, MODES, 1, 2, false, false, 11, 8));
  supine_basis *basis = open_as(&o, SUPINE_STORAGE_EXACT, SUPINE_SIMD_AUTO);
  float attributes[VERTICES * FLOATS];
  float uniforms[SLOTS];
  float gains[6];
  const double weights[MODES] = {0.3, -0.7, 1.9, 0.4, -2.2};
  const double scales[2] = {2.0, -0.5};
  memset(attributes, 0x77, sizeof attributes);
  memset(uniforms, 0x77, sizeof uniforms);
  assert_int_equal(supine_gl_pack(basis, 0, VERTICES, attributes), SUPINE_OK);
  assert_int_equal(supine_gl_weights(basis, POSED(basis, weights, scales), uniforms, gains),
                   SUPINE_OK);
  for (size_t k = 0; k < SLOTS; ++k) {
    assert_true(uniforms[k] == (k < MODES ? (float)weights[k] : 0.0F));
  }
  for (size_t k = 0; k < 6; ++k) {
    assert_true(gains[k] == (float)scales[k / 3]);
  }
  for (size_t i = 0; i < VERTICES; ++i) {
    assert_true(attributes[FLOATS * i + 3] == (float)o.f->lung[i]);
    for (size_t k = 0; k < MODES; ++k) {
      assert_true(attributes[FLOATS * i + SUPINE_GL_FLOATS + k] == o.f->coefficient[MODES * i + k]);
    }
  }
  supine_basis_close(basis);
  drop(&o);
}

TEST(test_normals_bipyramid_area_weighted) {
  opened o = made(fixture_create(40, 2, 1, 2, false, false, 11, 8));
  supine_basis *basis = open_as(&o, SUPINE_STORAGE_AUTO, SUPINE_SIMD_AUTO);
  float normals[120];
  supine_normals(basis, o.f->vertex, normals);
  double sums[120] = {0};
  for (size_t t = 0; t < o.f->triangles; ++t) {
    const uint32_t *corner = o.f->triangle + 3 * t;
    double u[3];
    double v[3];
    for (size_t axis = 0; axis < 3; ++axis) {
      const double origin = (double)o.f->vertex[3 * corner[0] + axis];
      u[axis] = (double)o.f->vertex[3 * corner[1] + axis] - origin;
      v[axis] = (double)o.f->vertex[3 * corner[2] + axis] - origin;
    }
    for (size_t j = 0; j < 3; ++j) {
      for (size_t axis = 0; axis < 3; ++axis) {
        const size_t b = (axis + 1) % 3;
        const size_t c = (axis + 2) % 3;
        sums[3 * corner[j] + axis] += u[b] * v[c] - u[c] * v[b];
      }
    }
  }
  for (size_t i = 0; i < 40; ++i) {
    const double *s = sums + 3 * i;
    const double length = sqrt(s[0] * s[0] + s[1] * s[1] + s[2] * s[2]);
    assert_true(length > 0);
    for (size_t axis = 0; axis < 3; ++axis) {
      assert_true(fabs((double)normals[3 * i + axis] - s[axis] / length) <= 64 * 0x1p-24);
    }
  }
  /* The normal at the upper tip points up, so normals point outwards. */
  assert_true(normals[3 * 39 + 2] > 0.9F);
  /* The normals of a surface shrunk to a point are 0. */
  float point[120] = {0};
  supine_normals(basis, point, normals);
  for (size_t i = 0; i < 120; ++i) {
    assert_true(normals[i] == 0);
  }
  supine_basis_close(basis);
  drop(&o);
}

/* Every function that evaluates a pose refuses one that another basis made, and writes nothing. */
TEST(test_evaluate_pose_of_another_basis_refused) {
  enum { N = 200 };
  fixture *lit = fixture_create_shrinking(N, 3, 5);
  fixture_add_normals(lit, 2, 6);
  opened o[2] = {made(lit), made(fixture_create_shrinking(N, 3, 7))};
  supine_basis *basis = open_as(&o[0], SUPINE_STORAGE_AUTO, SUPINE_SIMD_AUTO);
  supine_basis *other = open_as(&o[1], SUPINE_STORAGE_AUTO, SUPINE_SIMD_AUTO);
  const supine_state asked = {.gravity = {0.3, 0.8, -0.2}, .volume = {SUPINE_VOLUME_SCAN, -20}};
  const supine_status bad = SUPINE_ERROR_ARGUMENT;
  supine_compare *compare = NULL;
  supine_pose poses[2];
  float xyz[6 * N];
  float clean[6 * N];
  double numbers[64] = {0};
  memset(xyz, 77, sizeof xyz);
  memcpy(clean, xyz, sizeof xyz);
  assert_int_equal(supine_basis_pose(basis, &asked, &poses[0], NULL), SUPINE_OK);
  assert_int_equal(supine_basis_pose(other, &asked, &poses[1], NULL), SUPINE_OK);
  assert_int_equal(supine_compare_create(basis, &compare, NULL), SUPINE_OK);
  const supine_pose *foreign = &poses[1];
  assert_int_equal(supine_deform(basis, foreign, xyz), bad);
  assert_int_equal(supine_deform_range(basis, foreign, 0, 10, xyz), bad);
  assert_int_equal(supine_deform_batch(basis, 2, poses, 0, N, xyz), bad);
  assert_int_equal(supine_displace_range(basis, foreign, 0, 10, xyz), bad);
  assert_int_equal(supine_deform_lit(basis, foreign, xyz, xyz + 3 * N), bad);
  assert_int_equal(supine_deform_lit(basis, foreign, NULL, xyz), bad);
  assert_int_equal(supine_compare_distances(compare, foreign, NULL, xyz), bad);
  assert_int_equal(supine_compare_distances(compare, poses, foreign, xyz), bad);
  assert_int_equal(supine_gl_weights(basis, foreign, xyz, xyz + 3 * N), bad);
  assert_int_equal(supine_gl_normal_weights(basis, foreign, xyz), bad);
  assert_int_equal(supine_basis_volumes(basis, foreign, numbers), bad);
  assert_int_equal(supine_basis_normal_weights(basis, foreign, numbers), bad);
  assert_true(isinf(supine_basis_error(basis, foreign)));
  assert_int_equal(supine_deform_range(basis, poses, 5, 4, xyz), bad);
  assert_int_equal(supine_deform_range(basis, poses, 0, N + 1, xyz), bad);
  assert_memory_equal(xyz, clean, sizeof xyz);
  /* supine_basis_pose overwrites any pose; a pose whose weights were set by hand fits any basis. */
  assert_int_equal(supine_basis_pose(basis, &asked, &poses[1], NULL), SUPINE_OK);
  assert_int_equal(supine_deform_batch(basis, 2, poses, 0, N, xyz), SUPINE_OK);
  assert_memory_equal(xyz, xyz + 3 * N, sizeof xyz / 2);
  poses[1].basis = 0;
  assert_int_equal(supine_deform(other, &poses[1], xyz), SUPINE_OK);
  supine_compare_destroy(compare);
  supine_basis_close(basis);
  supine_basis_close(other);
  drop(&o[0]);
  drop(&o[1]);
}
