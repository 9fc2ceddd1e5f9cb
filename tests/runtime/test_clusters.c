/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compare positions of bases of clusters with those of the coefficients that they stand for. */
#include "tests/helpers/test.h"

#include <supine/compare.h>
#include <supine/runtime.h>

#include "tests/helpers/poses.h"
#include "tests/helpers/runtime_fixture.h"

enum { MODES = 5, CLUSTERS = 9 };

/* A synthetic basis of clusters, and the bytes of its file. */
typedef struct opened {
  fixture *f;
  unsigned char *bytes;
  size_t size;
} opened;

static opened made(size_t vertices, size_t lungs, size_t clusters) {
  opened o = {.f = fixture_create(vertices, MODES, 2, lungs, true, true, 1, 6011)};
  fixture_add_clusters(o.f, clusters, 5.3, 313);
  o.bytes = fixture_bytes(o.f, &o.size);
  return o;
}

static void drop(opened *o) {
  free(o->bytes);
  fixture_destroy(o->f);
}

static supine_basis *open_as(const opened *o, supine_simd simd) {
  return fixture_open(o->bytes, o->size, SUPINE_STORAGE_AUTO, simd);
}

/* Make a pose with other gains for each lung and axis. */
static supine_pose random_pose(uint64_t *random) {
  supine_pose pose = {.basis = 0};
  for (size_t k = 0; k < MODES; ++k) {
    pose.weights[k] = fixture_random(random);
  }
  for (size_t i = 0; i < 3 * (size_t)SUPINE_LUNGS_MAX; ++i) {
    pose.gains[i / 3][i % 3] = 2 * fixture_random(random);
  }
  return pose;
}

/* Compute the displacements [N, 3] of a pose in double precision, from the coefficients that the
 * library computes. */
static double *displace(const supine_basis *basis, const supine_pose *pose) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  double *u = fixture_allocate(3 * info->vertex_count, sizeof *u);
  float *c = fixture_allocate(3 * info->vertex_count * MODES, sizeof *c);
  assert_int_equal(supine_basis_coefficients(basis, 0, info->vertex_count, c), SUPINE_OK);
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    for (size_t row = 3 * info->lung_begin[lung]; row < 3 * info->lung_begin[lung + 1]; ++row) {
      for (size_t k = 0; k < MODES; ++k) {
        u[row] += pose->gains[lung][row % 3] * pose->weights[k] * (double)c[row * MODES + k];
      }
    }
  }
  free(c);
  return u;
}

/* Assert that vertices begin <= i < end are near their exact positions, or their displacements if
 * `reference` is NULL. Vertex i is at xyz + (i - begin) * stride. */
static void assert_near(const float *xyz, size_t stride, const float *reference, const double *u,
                        size_t begin, size_t end, double error) {
  for (size_t i = begin; i < end; ++i) {
    double square = 0;
    for (size_t axis = 0; axis < 3; ++axis) {
      const double p = reference == NULL ? 0 : (double)reference[3 * i + axis];
      const double apart = (double)xyz[(i - begin) * stride + axis] - p - u[3 * i + axis];
      square += apart * apart;
    }
    if (!(sqrt(square) <= error)) {
      fail_msg("vertex %zu of %zu to %zu errs by %g mm, more than %g mm", i, begin, end,
               sqrt(square), error);
    }
  }
}

/* Check whole bases, ranges, strided buffers and displacements of one pose. */
static void check_pose(const supine_basis *basis, const supine_pose *pose) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  const size_t n = info->vertex_count;
  const size_t ranges[][2] = {{0, n},     {0, 1},         {n / 3, n},
                              {n - 1, n}, {n / 2, n / 2}, {n / 5, n / 2}};
  const double error = supine_basis_error(basis, pose);
  double *u = displace(basis, pose);
  float *xyz = fixture_allocate(3 * n, sizeof *xyz);
  float *wide = fixture_allocate(5 * n, sizeof *wide);
  assert_true(error < 0.01);
  assert_int_equal(supine_deform(basis, pose, xyz), SUPINE_OK);
  assert_near(xyz, 3, info->vertices, u, 0, n, error);
  for (size_t r = 0; r < sizeof ranges / sizeof *ranges; ++r) {
    const size_t begin = ranges[r][0];
    const size_t end = ranges[r][1];
    assert_int_equal(supine_deform_range(basis, pose, begin, end, xyz), SUPINE_OK);
    assert_near(xyz, 3, info->vertices, u, begin, end, error);
    assert_int_equal(supine_displace_range(basis, pose, begin, end, xyz), SUPINE_OK);
    assert_near(xyz, 3, NULL, u, begin, end, error);
    for (size_t i = 0; i < 5 * n; ++i) {
      wide[i] = 77;
    }
    assert_int_equal(supine_deform_strided(basis, pose, begin, end, 5 * sizeof *wide, wide),
                     SUPINE_OK);
    assert_near(wide, 5, info->vertices, u, begin, end, error);
    for (size_t i = 0; i < end - begin; ++i) {
      assert_true(wide[5 * i + 3] == 77 && wide[5 * i + 4] == 77);
    }
  }
  free(u);
  free(xyz);
  free(wide);
}

static void check_batch(const supine_basis *basis, const supine_pose *poses, size_t count) {
  const size_t n = supine_basis_get_info(basis)->vertex_count;
  const size_t begin = n / 7;
  const size_t size = n - begin;
  float *together = fixture_allocate(3 * count * size, sizeof *together);
  float *alone = fixture_allocate(3 * size, sizeof *alone);
  assert_int_equal(supine_deform_batch(basis, count, poses, begin, n, together), SUPINE_OK);
  for (size_t j = 0; j < count; ++j) {
    assert_int_equal(supine_deform_range(basis, &poses[j], begin, n, alone), SUPINE_OK);
    assert_memory_equal(alone, together + 3 * j * size, 3 * size * sizeof *alone);
  }
  free(together);
  free(alone);
}

TEST(test_deform_clusters_every_instruction_set_within_stated_error) {
  static const size_t sizes[] = {2, 15, 16, 17, 33, 100, 9001};
  for (size_t i = 0; i < sizeof sizes / sizeof *sizes; ++i) {
    const size_t lungs = sizes[i] < 16 ? 1 : 2;
    opened o = made(sizes[i], lungs, sizes[i] < CLUSTERS ? lungs : CLUSTERS);
    uint64_t random = sizes[i];
    for (int simd = 0; simd < SUPINE_SIMD_COUNT; ++simd) {
      supine_basis *basis = open_as(&o, (supine_simd)simd);
      if (basis != NULL) {
        const supine_pose poses[2] = {random_pose(&random), random_pose(&random)};
        check_pose(basis, &poses[0]);
        check_batch(basis, poses, 2);
        supine_basis_close(basis);
      }
    }
    drop(&o);
  }
}

TEST(test_coefficients_clusters_equal_formula) {
  opened o = made(100, 2, CLUSTERS);
  supine_basis *basis = open_as(&o, SUPINE_SIMD_AUTO);
  const supine_basis_info *info = supine_basis_get_info(basis);
  float c[3 * 100 * MODES];
  assert_null(info->coefficients);
  assert_int_equal(info->cluster_count, CLUSTERS);
  assert_int_equal(info->mode_count, MODES);
  assert_int_equal(info->storage, SUPINE_STORAGE_EXACT);
  assert_memory_equal(info->cluster, o.f->cluster, 100 * sizeof *info->cluster);
  assert_memory_equal(info->cluster_scalars, o.f->scalar, 200 * sizeof *info->cluster_scalars);
  assert_int_equal(supine_basis_coefficients(basis, 7, 93, c), SUPINE_OK);
  for (size_t i = 0; i < (size_t)3 * 86 * MODES; ++i) {
    const double want = (double)o.f->coefficient[3 * 7 * MODES + i];
    assert_true(fabs((double)c[i] - want) <= 1e-6 * (1 + fabs(want)));
  }
  assert_int_equal(supine_basis_coefficients(basis, 7, 101, c), SUPINE_ERROR_ARGUMENT);
  assert_int_equal(supine_basis_coefficients(basis, 8, 7, c), SUPINE_ERROR_ARGUMENT);
  supine_basis_close(basis);
  drop(&o);
}

TEST(test_coefficients_scalar_basis_unsupported) {
  opened o = {.f = fixture_create(20, 2, 1, 1, false, false, 1, 3)};
  o.bytes = fixture_bytes(o.f, &o.size);
  supine_basis *basis = open_as(&o, SUPINE_SIMD_AUTO);
  float c[6];
  assert_int_equal(supine_basis_coefficients(basis, 0, 1, c), SUPINE_ERROR_UNSUPPORTED);
  supine_basis_close(basis);
  drop(&o);
}

/* The volumes that the file states are those of the deformed triangles. */
TEST(test_volumes_clusters_equal_triangles) {
  opened o = made(100, 2, CLUSTERS);
  supine_basis *basis = open_as(&o, SUPINE_SIMD_AUTO);
  const supine_basis_info *info = supine_basis_get_info(basis);
  uint64_t random = 5;
  const supine_pose pose = random_pose(&random);
  double *xyz = displace(basis, &pose);
  double volumes[2];
  for (size_t i = 0; i < 300; ++i) {
    xyz[i] += (double)info->vertices[i];
  }
  assert_int_equal(supine_basis_volumes(basis, &pose, volumes), SUPINE_OK);
  for (size_t lung = 0; lung < 2; ++lung) {
    assert_true(fabs(volumes[lung] - fixture_volume(o.f, lung, xyz)) < 1e-3);
  }
  free(xyz);
  supine_basis_close(basis);
  drop(&o);
}

/* Distances follow from clusters as from stored coefficients. */
TEST(test_distances_clusters_equal_stored_coefficients) {
  opened o = made(100, 2, CLUSTERS);
  opened stored = {.f = fixture_create(100, MODES, 2, 2, true, true, 1, 6011)};
  memcpy(stored.f->coefficient, o.f->coefficient, 300 * MODES * sizeof(float));
  stored.bytes = fixture_bytes(stored.f, &stored.size);
  supine_basis *const bases[2] = {open_as(&o, SUPINE_SIMD_AUTO),
                                  open_as(&stored, SUPINE_SIMD_AUTO)};
  uint64_t random = 71;
  const supine_pose pose = random_pose(&random);
  float distance[2][100];
  for (size_t b = 0; b < 2; ++b) {
    supine_compare *compare = NULL;
    assert_int_equal(supine_compare_create(bases[b], &compare, NULL), SUPINE_OK);
    assert_int_equal(supine_compare_distances(compare, &pose, NULL, distance[b]), SUPINE_OK);
    supine_compare_destroy(compare);
    supine_basis_close(bases[b]);
  }
  for (size_t i = 0; i < 100; ++i) {
    assert_true(fabsf(distance[0][i] - distance[1][i]) <= 1e-4F);
  }
  drop(&o);
  drop(&stored);
}

/* The frames and attributes of the shader give the displacements of the fixture. A range has the
 * attributes of its vertices. */
TEST(test_gl_clusters_displace_like_fixture) {
  opened o = made(100, 2, CLUSTERS);
  supine_basis *basis = open_as(&o, SUPINE_SIMD_AUTO);
  uint64_t random = 72;
  const supine_pose pose = random_pose(&random);
  supine_gl_clustered_vertex vertices[100];
  float frames[CLUSTERS][6][4];
  assert_int_equal(supine_gl_pack_clusters(basis, 0, 30, vertices), SUPINE_OK);
  assert_int_equal(supine_gl_pack_clusters(basis, 30, 100, vertices + 30), SUPINE_OK);
  assert_int_equal(supine_gl_frames(basis, &pose, frames[0][0]), SUPINE_OK);
  double *displaced = displace(basis, &pose);
  for (size_t i = 0; i < 100; ++i) {
    const supine_gl_clustered_vertex *v = &vertices[i];
    assert_int_equal(v->lung, o.f->lung[i]);
    for (size_t axis = 0; axis < 3; ++axis) {
      double x = (double)frames[v->cluster][0][axis];
      for (size_t j = 0; j < 3; ++j) {
        x += (double)frames[v->cluster][1 + j][axis] * (double)v->reference[j];
      }
      for (size_t j = 0; j < 2; ++j) {
        x += (double)frames[v->cluster][4 + j][axis] * v->scalars[j];
      }
      assert_true(fabs(x - (double)o.f->vertex[3 * i + axis] - displaced[3 * i + axis]) < 1e-3);
    }
  }
  free(displaced);
  supine_basis_close(basis);
  drop(&o);
}

/* Clusters are never expanded for the shader, and modes have no clusters. */
TEST(test_gl_other_kind_of_basis_unsupported) {
  opened o = made(100, 2, CLUSTERS);
  opened modes = {.f = fixture_create(20, MODES, 2, 2, true, true, 1, 6011)};
  modes.bytes = fixture_bytes(modes.f, &modes.size);
  supine_basis *clusters = open_as(&o, SUPINE_SIMD_AUTO);
  supine_basis *basis = open_as(&modes, SUPINE_SIMD_AUTO);
  const supine_pose pose = {.gains = {{1, 1, 1}}};
  supine_gl_clustered_vertex vertex;
  float numbers[2][64];
  assert_int_equal(supine_gl_pack(clusters, 0, 1, numbers[0]), SUPINE_ERROR_UNSUPPORTED);
  assert_int_equal(supine_gl_weights(clusters, &pose, numbers[0], numbers[1]),
                   SUPINE_ERROR_UNSUPPORTED);
  assert_int_equal(supine_gl_pack_clusters(basis, 0, 1, &vertex), SUPINE_ERROR_UNSUPPORTED);
  assert_int_equal(supine_gl_frames(basis, &pose, numbers[0]), SUPINE_ERROR_UNSUPPORTED);
  supine_basis_close(basis);
  supine_basis_close(clusters);
  drop(&modes);
  drop(&o);
}

/* A pose of another basis, or with a number that is not finite, has no frames. */
TEST(test_gl_frames_wrong_pose_refused) {
  opened o = made(100, 2, CLUSTERS);
  supine_basis *basis = open_as(&o, SUPINE_SIMD_AUTO);
  float frames[CLUSTERS * SUPINE_GL_FRAME_FLOATS];
  supine_pose pose = {.basis = supine_basis_get_info(basis)->identity + 1};
  assert_int_equal(supine_gl_frames(basis, &pose, frames), SUPINE_ERROR_ARGUMENT);
  pose = (supine_pose){.weights = {NAN}};
  assert_int_equal(supine_gl_frames(basis, &pose, frames), SUPINE_ERROR_ARGUMENT);
  supine_basis_close(basis);
  drop(&o);
}

/* Open a file that a changed fixture writes, and assert that it is refused for this reason. */
static void assert_refused(const fixture *f, const char *reason) {
  size_t size = 0;
  unsigned char *bytes = fixture_bytes(f, &size);
  supine_basis *basis = NULL;
  supine_error error = {0};
  assert_int_equal(supine_basis_open_memory(bytes, size, &basis, &error), SUPINE_ERROR_FORMAT);
  assert_null(basis);
  assert_says(error.message, reason);
  free(bytes);
}

TEST(test_open_wrong_clusters_refused_with_reason) {
  opened o = made(20, 2, CLUSTERS);
  const uint16_t cluster = o.f->cluster[13];
  o.f->cluster[13] = CLUSTERS;
  assert_refused(o.f, "vertex 13 is in cluster 9 of 9");
  o.f->cluster[13] = UINT16_MAX;
  assert_refused(o.f, "vertex 13 is in cluster 65535 of 9");
  o.f->cluster[13] = o.f->cluster[0];
  assert_refused(o.f, "cluster 0 has vertices of two lungs");
  o.f->cluster[13] = cluster;
  o.f->cluster_vector[17] = NAN;
  assert_refused(o.f, "'cluster_vectors' has a number that is not finite");
  o.f->cluster_vector[17] = 1e9F;
  assert_refused(o.f, "modes have weights of up to");
  o.f->cluster_vector[17] = 0;
  o.f->vector = false;
  assert_refused(o.f, "9 clusters of a basis of kind scalar");
  drop(&o);
}

TEST(test_open_too_many_clusters_refused) {
  opened most = made(600, 1, SUPINE_CLUSTERS_MAX);
  supine_basis *basis = open_as(&most, SUPINE_SIMD_AUTO);
  uint64_t random = 8;
  const supine_pose pose = random_pose(&random);
  check_pose(basis, &pose);
  supine_basis_close(basis);
  drop(&most);
  fixture *f = fixture_create(600, MODES, 2, 1, true, false, 1, 6011);
  fixture_add_clusters(f, SUPINE_CLUSTERS_MAX + 1, 5.3, 313);
  assert_refused(f, "513 clusters of a basis of kind vector, not 1 to 512");
  fixture_destroy(f);
}

/* Write a basis of clusters with a rigid part, and open it. */
static supine_basis *open_rigid(const fixture *f, const uint32_t part[2], unsigned char **bytes) {
  const supine_metadata metadata[] = {
      {"format", "supine-basis"}, {"version", "4"}, {"kind", "vector"}};
  const size_t n = f->vertices;
  const supine_tensor tensors[] = {
      {"vertices", SUPINE_F32, 2, {n, 3}, f->vertex},
      {"triangles", SUPINE_U32, 2, {f->triangles, 3}, f->triangle},
      {"modes", SUPINE_F64, 3, {MODES, 9, 1}, f->mode},
      {"lung", SUPINE_U8, 1, {n}, f->lung},
      {"clusters", SUPINE_U16, 1, {n}, f->cluster},
      {"cluster_scalars", SUPINE_I16, 2, {n, 2}, f->scalar},
      {"cluster_vectors", SUPINE_F32, 3, {f->clusters, MODES, 18}, f->cluster_vector},
      {"rigid", SUPINE_U32, 2, {1, 2}, part},
  };
  char *folder = fixture_folder();
  char path[128];
  size_t size = 0;
  supine_basis *basis = NULL;
  (void)snprintf(path, sizeof path, "%s/a", folder);
  assert_int_equal(
      supine_safetensors_write(path, tensors, sizeof tensors / sizeof *tensors, metadata, 3, NULL),
      SUPINE_OK);
  *bytes = test_read(path, &size);
  fixture_folder_remove(folder);
  assert_int_equal(supine_basis_open_memory(*bytes, size, &basis, NULL), SUPINE_OK);
  return basis;
}

/* A rigid part keeps the distances between its vertices, near the positions of a soft one. */
TEST(test_deform_clusters_rigid_part_keeps_distances) {
  static const uint32_t part[2] = {55, 75};
  opened o = made(100, 2, CLUSTERS);
  unsigned char *bytes = NULL;
  supine_basis *soft = open_as(&o, SUPINE_SIMD_AUTO);
  supine_basis *rigid = open_rigid(o.f, part, &bytes);
  uint64_t random = 12;
  const supine_pose pose = random_pose(&random);
  float x[2][300];
  assert_int_equal(supine_deform(soft, &pose, x[0]), SUPINE_OK);
  assert_int_equal(supine_deform(rigid, &pose, x[1]), SUPINE_OK);
  for (size_t i = 0; i < 100; ++i) {
    if (i < part[0] || i >= part[1]) {
      assert_memory_equal(x[0] + 3 * i, x[1] + 3 * i, 3 * sizeof(float));
    }
  }
  double mean[2][3] = {{0}};
  for (size_t i = part[0]; i < part[1]; ++i) {
    double square[2] = {0, 0};
    for (size_t axis = 0; axis < 3; ++axis) {
      const size_t first = 3 * (size_t)part[0] + axis;
      square[0] += pow((double)o.f->vertex[3 * i + axis] - (double)o.f->vertex[first], 2);
      square[1] += pow((double)x[1][3 * i + axis] - (double)x[1][first], 2);
      mean[0][axis] += (double)x[0][3 * i + axis] / (part[1] - part[0]);
      mean[1][axis] += (double)x[1][3 * i + axis] / (part[1] - part[0]);
    }
    assert_true(fabs(sqrt(square[0]) - sqrt(square[1])) < 1e-3);
  }
  for (size_t axis = 0; axis < 3; ++axis) {
    assert_true(fabs(mean[0][axis] - mean[1][axis]) < 1e-3);
  }
  supine_basis_close(soft);
  supine_basis_close(rigid);
  free(bytes);
  drop(&o);
}
