/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test displacements of another simulator: loading, fit, cross-validation, refused input. */

#include "folder.h"
#include "precompute/fields/fields.h"
#include "precompute/lungs/phantom.h"
#include "precompute/physics/solve.h"
#include "precompute/precompute.h"
#include <supine/runtime.h>
#include <supine/safetensors.h>

#include <supine/sh.h>

#include "lungs_helpers.h"

#include "tests/poses.h"

static supine_lungs lungs;

static int setup(void **state) {
  supine_mesh mesh = {0};
  if (folder_make(state) != 0 || supine_phantom_create(400, 2500.0, &mesh, NULL) != SUPINE_OK ||
      supine_lungs_create(&mesh, 1, NULL, &lungs, NULL) != SUPINE_OK) {
    return -1;
  }
  supine_mesh_free(&mesh);
  return 0;
}

static int teardown(void **state) {
  supine_lungs_free(&lungs);
  return folder_remove(state);
}

/* Solve the equilibrium for `count` random directions of gravity, and return the displacements. */
static supine_fields physics_fields(const supine_lungs *of, size_t count, uint64_t seed,
                                    double soften) {
  const size_t n = of->mesh.vertex_count;
  supine_fields fields = {.direction_count = count, .vertex_count = n};
  supine_model model = supine_physics_model(SUPINE_LAW_PAPER);
  model.force.soften = soften;
  model.reach = soften != 0.0 ? 10.0 : 0.0;
  fields.directions = malloc(3 * count * sizeof(double));
  fields.displacement = malloc(3 * count * n * sizeof(double));
  for (size_t d = 0; d < count; ++d) {
    supine_solution solution = {0};
    double *u = fields.displacement + 3 * d * n;
    random_direction(&seed, fields.directions + 3 * d);
    assert_int_equal(supine_physics_solve(of, &model, fields.directions + 3 * d, &solution, NULL),
                     SUPINE_OK);
    supine_physics_solution_apply(&solution, &of->mesh, 1.0, u);
    for (size_t i = 0; i < 3 * n; ++i) {
      u[i] -= of->mesh.vertices[i];
    }
    supine_physics_solution_free(&solution);
  }
  return fields;
}

/* Return displacements that are random sums of harmonics up to degree `band`. */
static supine_fields band_limited_fields(size_t band, size_t count, const double *directions) {
  const size_t n = lungs.mesh.vertex_count;
  const size_t terms = supine_sh_count(band);
  supine_fields fields = {.direction_count = count, .vertex_count = n};
  double *c = calloc(3 * n * terms, sizeof *c);
  double *y = calloc(terms, sizeof *y);
  uint64_t seed = 5;
  for (size_t i = 0; i < 3 * n * terms; ++i) {
    c[i] = random_signed(&seed);
  }
  fields.directions = malloc(3 * count * sizeof(double));
  fields.displacement = calloc(3 * count * n, sizeof(double));
  memcpy(fields.directions, directions, 3 * count * sizeof(double));
  for (size_t d = 0; d < count; ++d) {
    assert_int_equal(supine_sh_evaluate(band, directions + 3 * d, y), SUPINE_OK);
    for (size_t i = 0; i < 3 * n; ++i) {
      for (size_t t = 0; t < terms; ++t) {
        fields.displacement[3 * d * n + i] += c[i * terms + t] * y[t];
      }
    }
  }
  free(c);
  free(y);
  return fields;
}

static void check_band_limited(const supine_fields *fields, size_t band) {
  const supine_fit_options options = {.band = -1, .modes = 0};
  supine_compression field;
  supine_fit_report report;
  supine_error error;
  if (supine_fields_fit(fields, &options, &field, &report, &error) != SUPINE_OK) {
    fail_msg("%s", error.message);
  }
  assert_int_equal(report.band, band);
  assert_true(report.accuracy.relative_rms < 1e-6);
  assert_int_equal(field.row_count, 3 * fields->vertex_count);
  supine_sh_compression_free(&field);
}

TEST(test_fit_band_limited_fields_recovered) {
  enum { COUNT = 40 };
  double directions[3 * COUNT];
  uint64_t seed = 17;
  for (size_t d = 0; d < COUNT; ++d) {
    random_direction(&seed, directions + 3 * d);
  }
  supine_fields fields = band_limited_fields(3, COUNT, directions);
  check_band_limited(&fields, 3);
  supine_fields_free(&fields);
}

/* The leave-one-out error in closed form equals the error of refits that omit one direction. */
TEST(test_fit_leave_one_out_error_equals_refits) {
  enum { COUNT = 24, BAND = 2 };
  supine_fields fields = physics_fields(&lungs, COUNT, 99, 1.0);
  const size_t n = fields.vertex_count;
  const supine_fit_options options = {.band = BAND, .modes = 0};
  supine_compression field;
  supine_fit_report report;
  assert_int_equal(supine_fields_fit(&fields, &options, &field, &report, NULL), SUPINE_OK);
  supine_sh_compression_free(&field);
  double error2 = 0.0;
  double field2 = 0.0;
  for (size_t out = 0; out < COUNT; ++out) {
    supine_fields rest = {.direction_count = COUNT - 1, .vertex_count = n};
    double y[9];
    rest.directions = malloc(3 * (COUNT - 1) * sizeof(double));
    rest.displacement = malloc(3 * (COUNT - 1) * n * sizeof(double));
    for (size_t d = 0, at = 0; d < COUNT; ++d) {
      if (d != out) {
        memcpy(rest.directions + 3 * at, fields.directions + 3 * d, 3 * sizeof(double));
        memcpy(rest.displacement + 3 * n * at, fields.displacement + 3 * n * d,
               3 * n * sizeof(double));
        ++at;
      }
    }
    supine_fit_report ignored;
    assert_int_equal(supine_fields_fit(&rest, &options, &field, &ignored, NULL), SUPINE_OK);
    assert_int_equal(supine_sh_evaluate(BAND, fields.directions + 3 * out, y), SUPINE_OK);
    for (size_t i = 0; i < 3 * n; ++i) {
      double is = 0.0;
      for (size_t t = 0; t < 9; ++t) {
        is += (double)field.coefficients[i * 9 + t] * y[t];
      }
      const double should = fields.displacement[3 * n * out + i];
      error2 += (is - should) * (is - should);
      field2 += should * should;
    }
    supine_sh_compression_free(&field);
    supine_fields_free(&rest);
  }
  const double direct = sqrt(error2 / field2);
  assert_close(report.error[BAND], direct, 1e-5 * direct);
  assert_close(report.accuracy.relative_rms, direct, 1e-5 * direct);
  supine_fields_free(&fields);
}

/* Fit a basis to the displacements for 60 random directions of gravity. Compare the error that the
 * fit reports with the error in 40 other directions. */
static void check_stated_error(const supine_lungs *of, const char *what) {
  supine_fields fields = physics_fields(of, 60, 2008, 1.0);
  supine_fields others = physics_fields(of, 40, 1999, 1.0);
  const supine_fit_options options = {.band = -1, .modes = 16};
  const char *path = in_folder("basis.safetensors");
  supine_fit_report report;
  supine_error error;
  if (supine_precompute_fields(of, &fields, &options, path, &report, &error) != SUPINE_OK) {
    fail_msg("%s", error.message);
  }
  const supine_basis_options exact = {sizeof exact, .storage = SUPINE_STORAGE_EXACT};
  supine_basis *basis = NULL;
  assert_int_equal(supine_basis_open_with(path, &exact, &basis, NULL), SUPINE_OK);
  assert_int_equal(supine_basis_get_info(basis)->vector, true);
  const size_t n = of->mesh.vertex_count;
  float *xyz = malloc(3 * n * sizeof *xyz);
  double error2 = 0.0;
  double field2 = 0.0;
  for (size_t d = 0; d < others.direction_count; ++d) {
    const double *g = others.directions + 3 * d;
    /* A state without a volume gives the fitted displacements, not scaled. */
    supine_state posture = {.gravity = {g[0], g[1], g[2]}};
    supine_pose pose;
    assert_int_equal(supine_basis_pose(basis, &posture, &pose, NULL), SUPINE_OK);
    supine_deform(basis, &pose, xyz);
    posture.volume.kind = SUPINE_VOLUME_REST; /* must be refused: the volume at rest is unknown */
    assert_int_equal(supine_basis_pose(basis, &posture, &pose, NULL), SUPINE_ERROR_ARGUMENT);
    posture.volume.kind = SUPINE_VOLUME_FULL;
    assert_int_equal(supine_basis_pose(basis, &posture, &pose, NULL), SUPINE_ERROR_ARGUMENT);
    for (size_t i = 0; i < 3 * n; ++i) {
      const double should = others.displacement[3 * n * d + i];
      const double is = (double)xyz[i] - (double)(float)of->mesh.vertices[i];
      error2 += (is - should) * (is - should);
      field2 += should * should;
    }
  }
  const double truth = sqrt(error2 / field2);
  printf("%s, fitted to 60 directions with band %zu: reported error %.2f %%, error in 40 other "
         "directions %.2f %%\n",
         what, report.band, 100.0 * report.accuracy.relative_rms, 100.0 * truth);
  assert_true(report.accuracy.relative_rms > truth / 1.3333 &&
              report.accuracy.relative_rms < truth * 1.3333);
  free(xyz);
  supine_basis_close(basis);
  supine_fields_free(&fields);
  supine_fields_free(&others);
}

TEST(test_fit_other_directions_error_as_stated) {
  check_stated_error(&lungs, "phantom");
}

TEST(test_fit_real_lung_other_directions_error_as_stated) {
  static const char *const names[] = {"lungs/chaste_left_5k.obj"};
  supine_lungs real = {0};
  if (!helper_real_lungs(names, 1, SUPINE_AXES_AUTO, &real)) {
    skip();
    return;
  }
  check_stated_error(&real, "chaste_left_5k");
  supine_lungs_free(&real);
}

/* Fit the sum of displacements of band 1, noise, and `amount` times displacements of band 2. Set
 * `band` to the band that the fit chooses. Return the leave-one-out error with band 2 divided by
 * that with band 1. */
static double gain_of_band_2(double amount, size_t *band) {
  enum { COUNT = 60 };
  double directions[3 * COUNT];
  uint64_t seed = 23;
  for (size_t d = 0; d < COUNT; ++d) {
    random_direction(&seed, directions + 3 * d);
  }
  supine_fields fields = band_limited_fields(1, COUNT, directions);
  supine_fields more = band_limited_fields(2, COUNT, directions);
  const supine_fit_options options = {.band = -1, .modes = 0};
  supine_compression field;
  supine_fit_report report;
  for (size_t i = 0; i < 3 * COUNT * fields.vertex_count; ++i) {
    fields.displacement[i] += amount * more.displacement[i] + random_signed(&seed);
  }
  assert_int_equal(supine_fields_fit(&fields, &options, &field, &report, NULL), SUPINE_OK);
  supine_sh_compression_free(&field);
  supine_fields_free(&fields);
  supine_fields_free(&more);
  *band = report.band;
  return report.error[2] / report.error[1];
}

/* The fit chooses band 2 if this lowers the error by 1.5 %, but not if by only 0.5 %. */
TEST(test_fit_band_reducing_error_by_half_a_percent_not_chosen) {
  static const double wanted[] = {0.995, 0.985};
  for (size_t i = 0; i < 2; ++i) {
    double range[2] = {0.0, 2.0};
    size_t band = 0;
    for (int step = 0; step < 20; ++step) {
      const double middle = 0.5 * (range[0] + range[1]);
      range[gain_of_band_2(middle, &band) > wanted[i] ? 0 : 1] = middle;
    }
    assert_close(gain_of_band_2(range[1], &band), wanted[i], 1e-3);
    assert_int_equal(band, 1 + i);
  }
}

TEST(test_fit_vector_volumes_exact) {
  supine_fields fields = physics_fields(&lungs, 30, 21, 1.0);
  const supine_fit_options options = {.band = -1, .modes = 8};
  const char *path = in_folder("volume.safetensors");
  supine_fit_report report;
  assert_int_equal(supine_precompute_fields(&lungs, &fields, &options, path, &report, NULL),
                   SUPINE_OK);
  const supine_basis_options exact = {sizeof exact, .storage = SUPINE_STORAGE_EXACT};
  supine_basis *basis = NULL;
  assert_int_equal(supine_basis_open_with(path, &exact, &basis, NULL), SUPINE_OK);
  const size_t n = lungs.mesh.vertex_count;
  float *xyz = malloc(3 * n * sizeof *xyz);
  double *moved = malloc(3 * n * sizeof *moved);
  supine_mesh mesh = lungs.mesh;
  uint64_t seed = 77;
  for (size_t d = 0; d < 10; ++d) {
    double g[3];
    double weights[SUPINE_MODES_MAX];
    double scales[2];
    random_direction(&seed, g);
    assert_int_equal(supine_basis_weights(basis, g, weights), SUPINE_OK);
    assert_int_equal(posed_scale(basis, weights, 200.0, scales, NULL), SUPINE_OK);
    scales[1] = scales[0];
    supine_deform(basis, POSED(basis, weights, scales), xyz);
    for (size_t i = 0; i < 3 * n; ++i) {
      moved[i] = (double)xyz[i];
    }
    mesh.vertices = moved;
    const double full = supine_mesh_volume(&mesh);
    for (size_t i = 0; i < 3 * n; ++i) {
      moved[i] = (double)(float)lungs.mesh.vertices[i];
    }
    assert_close(1e-3 * (full - supine_mesh_volume(&mesh)), 200.0, 0.05);
  }
  free(xyz);
  free(moved);
  supine_basis_close(basis);
  supine_fields_free(&fields);
}

TEST(test_fit_few_directions_limit_the_band) {
  supine_fields fields = physics_fields(&lungs, 10, 4, 1.0);
  supine_fit_options options = {.band = -1, .modes = 16};
  supine_compression field;
  supine_fit_report report;
  supine_error error;
  assert_int_equal(supine_fields_fit(&fields, &options, &field, &report, NULL), SUPINE_OK);
  assert_in_range(report.band_highest, 1, 2);
  assert_true(report.band <= report.band_highest);
  supine_sh_compression_free(&field);
  options.band = 4;
  assert_int_equal(supine_fields_fit(&fields, &options, &field, &report, &error),
                   SUPINE_ERROR_ARGUMENT);
  assert_says(error.message, "10 directions do not determine band 4 (25 harmonics)");
  fields.direction_count = 1;
  assert_int_equal(supine_fields_fit(&fields, &options, &field, &report, &error),
                   SUPINE_ERROR_ARGUMENT);
  assert_says(error.message, "at least two");
  fields.direction_count = 10;
  memset(fields.displacement, 0, 3 * 10 * fields.vertex_count * sizeof(double));
  assert_int_equal(supine_fields_fit(&fields, &options, &field, &report, &error),
                   SUPINE_ERROR_NUMERICAL);
  supine_fields_free(&fields);
}

/* Assert that loading a file fails with this status and message. */
static void expect_failure(const char *name, supine_status status, const char *words) {
  supine_fields fields = {0};
  supine_error error = {0};
  assert_int_equal(supine_fields_load(in_folder(name), &lungs, NULL, &fields, &error), status);
  assert_says(error.message, words);
  assert_null(fields.directions);
}

TEST(test_fields_load_bad_tensors_refused) {
  const size_t n = lungs.mesh.vertex_count;
  double gravity[6] = {0, 1, 0, 0, 0, -2};
  float *displacement = calloc(6 * n, sizeof *displacement);
  displacement[3 * n + 4] = 0.5F;
  supine_tensor tensors[2] = {{"gravity", SUPINE_F64, 2, {2, 3}, gravity},
                              {"displacement", SUPINE_F32, 3, {2, n, 3}, displacement}};
  const char *path = in_folder("fields.safetensors");
  supine_fields fields = {0};
  assert_int_equal(supine_safetensors_write(path, tensors, 2, NULL, 0, NULL), SUPINE_OK);
  assert_int_equal(supine_fields_load(path, &lungs, NULL, &fields, NULL), SUPINE_OK);
  assert_close(fields.directions[5], -1.0, 0.0);
  assert_close(fields.displacement[3 * n + 4], 0.5, 0.0);
  supine_fields_free(&fields);
  displacement[3 * n + 3] = 0.25F;
  displacement[3 * n + 5] = 0.75F;
  const supine_mesh_load_options ras = {.axes = SUPINE_AXES_RAS, .millimetres_per_unit = 10.0};
  assert_int_equal(supine_safetensors_write(path, tensors, 2, NULL, 0, NULL), SUPINE_OK);
  assert_int_equal(supine_fields_load(path, &lungs, &ras, &fields, NULL), SUPINE_OK);
  assert_close(fields.displacement[3 * n + 3], -2.5, 0.0);
  assert_close(fields.displacement[3 * n + 4], -5.0, 0.0);
  assert_close(fields.displacement[3 * n + 5], 7.5, 0.0);
  supine_fields_free(&fields);
  displacement[3 * n + 4] = NAN;
  assert_int_equal(supine_safetensors_write(path, tensors, 2, NULL, 0, NULL), SUPINE_OK);
  expect_failure("fields.safetensors", SUPINE_ERROR_FORMAT, "row 1: the displacement of vertex 1");
  tensors[1].shape[1] = n / 2;
  assert_int_equal(supine_safetensors_write(path, tensors, 2, NULL, 0, NULL), SUPINE_OK);
  expect_failure("fields.safetensors", SUPINE_ERROR_MESH, "but the reference surface has");
  assert_int_equal(supine_safetensors_write(path, tensors, 1, NULL, 0, NULL), SUPINE_OK);
  expect_failure("fields.safetensors", SUPINE_ERROR_FORMAT, "displacement [M,N,3]");
  expect_failure("nothing.safetensors", SUPINE_ERROR_READ, "nothing.safetensors");
  displacement[3 * n + 4] = 0.0F;
  static const struct {
    double gravity[3];
    const char *words;
  } bad[] = {{{0, 3, 0}, "rows 0 and 1 have the same direction of gravity: keep one"},
             {{0, 0, 0}, "row 1: gravity 0,0,0 has no direction"},
             {{0, NAN, 0}, "has no direction"}};
  tensors[1].shape[1] = n;
  for (size_t i = 0; i < sizeof bad / sizeof *bad; ++i) {
    memcpy(gravity + 3, bad[i].gravity, sizeof bad[i].gravity);
    assert_int_equal(
        supine_safetensors_write(in_folder("fields.safetensors"), tensors, 2, NULL, 0, NULL),
        SUPINE_OK);
    expect_failure("fields.safetensors", SUPINE_ERROR_FORMAT, bad[i].words);
  }
  free(displacement);
}

TEST_GROUP(setup, teardown)
