/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compare the normals of supine_deform_lit, approximated by modes, with those of supine_normals,
 * computed from triangles, in random states from rest to full inflation. The angles between the two
 * normals are within the documented limits, and as large as the basis file states. */
#include "tests/helpers/test.h"

#include <supine/runtime.h>

#include "precompute/lungs/phantom.h"
#include "precompute/precompute.h"
#include "tests/helpers/basis_helpers.h"

#include "tests/helpers/lungs_helpers.h"

#include "tests/helpers/poses.h"

enum { STATES = 192 };

/* Documented limits of the mean and the 99.9th percentile of the angle between the approximate and
 * the exact normal, degrees. */
static const double mean_most = 0.1;
static const double p999_most = 1.0;
/* Largest relative rounding error of the angles stated in a basis file, which have two digits. */
static const double printed = 0.05;
/* Tolerance of the mean angle over all random states, in standard errors. */
static const double sigmas = 4.0;
/* Largest allowed ratio, either way, of the measured to the stated 99.9th percentile of the angle.
 * It is large because few of the measured angles determine the percentile. */
static const double p999_ratio_most = 1.4;

/* Make a basis of lungs scanned at full inflation. If `soften` > 0, lower tissue is softer. */
static supine_basis *make_basis(supine_lungs *lungs, double soften, size_t modes) {
  static const supine_scan full = {.known = true,
                                   .state = {.gravity = {0, 1, 0}, .volume = {SUPINE_VOLUME_FULL}}};
  const supine_resting resting = supine_physics_resting_default();
  supine_prepared prepared = {.model = supine_physics_model(SUPINE_LAW_DEEP)};
  supine_error error = {0};
  supine_basis *basis = NULL;
  char path[] = "/tmp/supine-angles-XXXXXX";
  const int file = mkstemp(path);
  assert_true(file >= 0 && close(file) == 0);
  const supine_basis_choice choice = {.band = 15, .modes = modes, .held_out = 20};
  prepared.model.force.soften = soften;
  prepared.source.lungs = *lungs;
  /* Use exact storage: rounded positions would change the normals of small triangles. */
  const supine_basis_options exact = {sizeof exact, .storage = SUPINE_STORAGE_EXACT};
  if (supine_physics_reference_find(&prepared.source.lungs, &prepared.model, &full, &resting,
                                    &prepared.reference, &error) != SUPINE_OK ||
      helper_write_basis(path, &prepared, &choice, NULL, &error) != SUPINE_OK ||
      supine_basis_open_with(path, &exact, &basis, &error) != SUPINE_OK) {
    fail_msg("%s", error.message);
  }
  *lungs = prepared.source.lungs;
  assert_int_equal(unlink(path), 0);
  return basis;
}

static int compare_floats(const void *left, const void *right) {
  const float a = *(const float *)left;
  const float b = *(const float *)right;
  return a < b ? -1 : a > b;
}

/* Set angles [N] to the angle, degrees, between the approximate normal (`lit`) and the exact normal
 * of each vertex in a random state. Return the mean angle. */
static double measure(const supine_basis *basis, uint64_t *seed, float *xyz, float *lit,
                      float *exact, float *angles) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  double gravity[3];
  supine_pose pose;
  double rest = 0.0;
  double sum = 0.0;
  supine_error error = {0};
  random_direction(seed, gravity);
  assert_int_equal(posed_rest(basis, gravity, &rest), SUPINE_OK);
  assert_true(rest < 0.0);
  const supine_state state = {.gravity = {gravity[0], gravity[1], gravity[2]},
                              .volume = {SUPINE_VOLUME_REST, -rest * helper_random(seed)}};
  assert_int_equal(supine_basis_pose(basis, &state, &pose, &error), SUPINE_OK);
  assert_int_equal(supine_deform_lit(basis, &pose, xyz, lit), SUPINE_OK);
  supine_normals(basis, xyz, exact);
  for (size_t i = 0; i < info->vertex_count; ++i) {
    double square = 0.0;
    for (size_t axis = 0; axis < 3; ++axis) {
      const double off = (double)lit[3 * i + axis] - (double)exact[3 * i + axis];
      square += off * off;
    }
    angles[i] = (float)(2.0 * asin(fmin(1.0, sqrt(square) / 2.0)) * 180.0 / M_PI);
    sum += (double)angles[i];
  }
  return sum / (double)info->vertex_count;
}

static void check_angles(supine_lungs *lungs, double soften, size_t modes) {
  supine_basis *basis = make_basis(lungs, soften, modes);
  const supine_basis_info *info = supine_basis_get_info(basis);
  const size_t n = info->vertex_count;
  uint64_t seed = 20261;
  float *xyz = calloc(3 * n, sizeof *xyz);
  float *lit = calloc(3 * n, sizeof *lit);
  float *exact = calloc(3 * n, sizeof *exact);
  float *angles = calloc(STATES * n, sizeof *angles);
  double sum = 0.0;
  double squares = 0.0;
  assert_true(xyz != NULL && lit != NULL && exact != NULL && angles != NULL);
  assert_true(info->normal_count > 0);
  for (size_t i = 0; i < STATES; ++i) {
    const double mean = measure(basis, &seed, xyz, lit, exact, angles + i * n);
    sum += mean;
    squares += mean * mean;
  }
  qsort(angles, STATES * n, sizeof *angles, compare_floats);
  const double mean = sum / STATES;
  const double error = sqrt((squares / STATES - mean * mean) / (STATES - 1));
  const double p999 = (double)angles[STATES * n * 999 / 1000];
  const char *said_mean = supine_basis_metadata(basis, "normals_mean_degrees");
  const char *said_p999 = supine_basis_metadata(basis, "normals_p999_degrees");
  assert_true(said_mean != NULL && said_p999 != NULL);
  printf("%zu vertices, %zu modes, %zu modes of normals: angles of %.3f degrees in the mean (%s in "
         "the file), 99.9th percentile %.2f degrees (%s in the file)\n",
         n, info->mode_count, info->normal_count, mean, said_mean, p999, said_p999);
  assert_true(mean <= mean_most);
  assert_true(p999 <= p999_most);
  assert_true(fabs(mean - strtod(said_mean, NULL)) <= sigmas * error + printed * mean);
  assert_true(p999 <= p999_ratio_most * strtod(said_p999, NULL));
  assert_true(strtod(said_p999, NULL) <= p999_ratio_most * p999);
  free(xyz);
  free(lit);
  free(exact);
  free(angles);
  supine_basis_close(basis);
}

static void check_real(const char *left, const char *right, supine_axes axes, double soften,
                       size_t modes) {
  const char *const names[] = {left, right};
  supine_lungs lungs = {0};
  if (!helper_real_lungs(names, 2, axes, &lungs)) {
    skip();
  }
  check_angles(&lungs, soften, modes);
  supine_lungs_free(&lungs);
}

TEST(test_deform_lit_synthetic_lungs_angles_as_stated) {
  supine_mesh mesh = {0};
  supine_lungs lungs = {0};
  assert_int_equal(supine_lungs_phantom_create(8000, 6000.0, &mesh, NULL), SUPINE_OK);
  assert_int_equal(supine_lungs_create(&mesh, 1, NULL, &lungs, NULL), SUPINE_OK);
  check_angles(&lungs, 0.0, 16);
  supine_mesh_free(&mesh);
  supine_lungs_free(&lungs);
}

TEST(test_deform_lit_adult_angles_as_stated) {
  check_real("left.obj", "right.obj", SUPINE_AXES_AUTO, 0.0, 16);
}

TEST(test_deform_lit_softened_adult_angles_as_stated) {
  check_real("left.obj", "right.obj", SUPINE_AXES_AUTO, 1.0, 16);
}

TEST_FULL(test_deform_lit_covid001_angles_as_stated) {
  check_real("covid/covid001_left.ply", "covid/covid001_right.ply", SUPINE_AXES_RAS, 0.0, 16);
}

TEST_FULL(test_deform_lit_covid005_angles_as_stated) {
  check_real("covid/covid005_left.ply", "covid/covid005_right.ply", SUPINE_AXES_RAS, 0.0, 16);
}
