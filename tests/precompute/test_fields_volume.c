/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test another simulator's displacements over gravity and volume: the fit, the volumes, and the
 * clusters of vertices that store it. */
#include "tests/helpers/test.h"

#include <stdlib.h>
#include <string.h>

#include <supine/runtime.h>

#include "base/vec3.h"
#include "precompute/lungs/phantom.h"
#include "precompute/precompute.h"

enum { DIRECTIONS = 20, VOLUMES = 4, RUNS = DIRECTIONS * VOLUMES };

static supine_lungs lungs;

static int setup(void **state) {
  supine_mesh mesh = {0};
  (void)state;
  if (supine_lungs_phantom_create(6000, 5000.0, &mesh, NULL) != SUPINE_OK ||
      supine_lungs_create(&mesh, 1, NULL, &lungs, NULL) != SUPINE_OK) {
    return -1;
  }
  supine_mesh_free(&mesh);
  return 0;
}

static int teardown(void **state) {
  (void)state;
  supine_lungs_free(&lungs);
  return 0;
}

/* A displacement that is nonlinear in the direction of gravity g and in the filling s, 0 to 1, of a
 * lung around its centre, mm. */
static void displace(const double g[3], double s, size_t vertex, double u[3]) {
  const size_t lung = lungs.lung_count == 2 && vertex >= lungs.lung_begin[1];
  double q[3];
  for (size_t i = 0; i < 3; ++i) {
    const double centre = 0.5 * (lungs.low[lung][i] + lungs.high[lung][i]);
    q[i] = (lungs.mesh.vertices[3 * vertex + i] - centre) / 100.0;
  }
  const double along = supine_dot(q, g);
  for (size_t i = 0; i < 3; ++i) {
    u[i] = 16.0 * s * q[i] +
           (1.0 - 0.6 * s) * ((7.0 - 3.0 * supine_dot(q, q)) * g[i] + 3.0 * tanh(along) * q[i]);
  }
  u[2] -= 4.0 * s * s * q[2] * q[2];
}

static supine_fields simulate(size_t directions, size_t volumes) {
  const size_t n = lungs.mesh.vertex_count;
  const size_t runs = directions * volumes;
  supine_fields made = {.run_count = runs, .vertex_count = n};
  made.directions = malloc(3 * runs * sizeof(double));
  made.displacement = malloc(3 * n * runs * sizeof(double));
  for (size_t run = 0; run < runs; ++run) {
    double *g = made.directions + 3 * run;
    const double s = volumes > 1 ? (double)(run % volumes) / (double)(volumes - 1) : 0.5;
    supine_spiral((double)(run / volumes), (double)directions, 0.0, g);
    for (size_t i = 0; i < n; ++i) {
      displace(g, s, i, made.displacement + 3 * (n * run + i));
    }
  }
  return made;
}

/* Make a basis of fields in memory. */
static supine_basis *make(const supine_fields *fields, supine_warp_storage storage,
                          supine_bytes *bytes, supine_basis_report *report) {
  supine_prepared prepared = {.fit = "", .source = {.lungs = lungs}};
  prepared.model.share[0] = prepared.model.share[1] = 1.0;
  const supine_basis_choice choice = {.modes = 16,
                                      .fields = fields,
                                      .choose_band = true,
                                      .storage = storage,
                                      .without_normals = true};
  supine_basis *basis = NULL;
  supine_error error = {0};
  if (supine_precompute(&prepared, &choice, bytes, report, &error) != SUPINE_OK ||
      supine_basis_open_memory(bytes->data, bytes->size, &basis, &error) != SUPINE_OK) {
    fail_msg("%s", error.message);
  }
  return basis;
}

/* Compute the volumes of the lungs in a state of displace(), mL, into a state of a basis that names
 * them. */
static void name_volumes(const double g[3], double s, supine_state *state) {
  const size_t n = lungs.mesh.vertex_count;
  double *moved = malloc(3 * n * sizeof *moved);
  for (size_t i = 0; i < n; ++i) {
    double u[3];
    displace(g, s, i, u);
    for (size_t axis = 0; axis < 3; ++axis) {
      moved[3 * i + axis] = lungs.mesh.vertices[3 * i + axis] + u[axis];
    }
  }
  *state = (supine_state){.gravity = {g[0], g[1], g[2]}, .lung_count = lungs.lung_count};
  for (size_t lung = 0; lung < lungs.lung_count; ++lung) {
    supine_mesh part = supine_lungs_part(&lungs, lung);
    part.vertices = moved;
    (void)snprintf(state->lungs[lung].name, sizeof state->lungs[lung].name, "%s",
                   supine_lungs_name(&lungs, lung));
    state->lungs[lung].volume =
        (supine_volume){SUPINE_VOLUME_ABSOLUTE, 1e-3 * supine_mesh_volume(&part)};
  }
  free(moved);
}

/* Assert that states which were not simulated come back within `limit`, relative RMS, with the
 * volumes that were asked. */
static void check_states(const supine_basis *basis, double limit) {
  const size_t n = lungs.mesh.vertex_count;
  float *xyz = malloc(3 * n * sizeof *xyz);
  double error2 = 0.0;
  double size2 = 0.0;
  for (size_t k = 0; k < 10; ++k) {
    double g[3];
    double volumes[SUPINE_LUNGS_MAX];
    supine_state state;
    supine_pose pose;
    const double s = 0.15 + 0.07 * (double)k;
    supine_spiral((double)k, 10.0, 0.37, g);
    name_volumes(g, s, &state);
    assert_int_equal(supine_basis_pose(basis, &state, &pose, NULL), SUPINE_OK);
    assert_int_equal(supine_basis_volumes(basis, &pose, volumes), SUPINE_OK);
    for (size_t lung = 0; lung < lungs.lung_count; ++lung) {
      assert_close(volumes[lung], state.lungs[lung].volume.ml, 1e-5);
    }
    assert_int_equal(supine_deform(basis, &pose, xyz), SUPINE_OK);
    for (size_t i = 0; i < n; ++i) {
      double u[3];
      displace(g, s, i, u);
      for (size_t axis = 0; axis < 3; ++axis) {
        const double moved = (double)xyz[3 * i + axis] - lungs.mesh.vertices[3 * i + axis];
        error2 += (moved - u[axis]) * (moved - u[axis]);
        size2 += u[axis] * u[axis];
      }
    }
  }
  free(xyz);
  assert_true(sqrt(error2 / size2) < limit);
}

static void check_storage(supine_warp_storage storage, bool clusters) {
  supine_fields fields = simulate(DIRECTIONS, VOLUMES);
  supine_bytes bytes = {.data = NULL};
  supine_basis_report report;
  supine_basis *basis = make(&fields, storage, &bytes, &report);
  assert_int_equal(supine_basis_get_info(basis)->cluster_count > 0, clusters);
  assert_int_equal(supine_basis_get_info(basis)->order, 2);
  assert_int_equal(report.fit.volume_count, VOLUMES);
  assert_true(report.accuracy.relative_rms < 0.01 && report.accuracy.relative_rms > 1e-4);
  check_states(basis, 2.0 * report.accuracy.relative_rms);
  supine_basis_close(basis);
  free(bytes.data);
  supine_fields_free(&fields);
}

TEST_GROUP(setup, teardown)

TEST(test_fields_over_volume_states_not_simulated_as_accurate_as_stated) {
  check_storage(SUPINE_FIELD_STORAGE_MODES, false);
}

TEST(test_fields_over_volume_clusters_as_accurate_as_stated) {
  check_storage(SUPINE_FIELD_STORAGE_BEST, true);
}

TEST(test_fields_over_volume_total_is_shared_and_range_is_refused) {
  supine_fields fields = simulate(DIRECTIONS, VOLUMES);
  supine_bytes bytes = {.data = NULL};
  supine_basis_report report;
  supine_basis *basis = make(&fields, SUPINE_FIELD_STORAGE_BEST, &bytes, &report);
  const double g[3] = {0.48, 0.6, -0.64};
  double volumes[SUPINE_LUNGS_MAX];
  supine_state named;
  supine_pose pose;
  supine_error error;
  name_volumes(g, 0.6, &named);
  double total = 0.0;
  for (size_t lung = 0; lung < lungs.lung_count; ++lung) {
    total += named.lungs[lung].volume.ml;
  }
  supine_state asked = {.gravity = {g[0], g[1], g[2]}, .volume = {SUPINE_VOLUME_ABSOLUTE, total}};
  assert_int_equal(supine_basis_pose(basis, &asked, &pose, NULL), SUPINE_OK);
  assert_int_equal(supine_basis_volumes(basis, &pose, volumes), SUPINE_OK);
  assert_close(volumes[0] + volumes[1], total, 1e-5);
  assert_close(volumes[0], named.lungs[0].volume.ml, 0.01 * total); /* the simulator's share */
  asked.volume.ml = 3.0 * total;
  assert_int_equal(supine_basis_pose(basis, &asked, &pose, &error), SUPINE_ERROR_NUMERICAL);
  assert_non_null(strstr(error.message, "in the simulations of this posture"));
  asked.volume = (supine_volume){SUPINE_VOLUME_REST, 0.0};
  assert_int_equal(supine_basis_pose(basis, &asked, &pose, &error), SUPINE_ERROR_ARGUMENT);
  asked.volume = (supine_volume){SUPINE_VOLUME_DEFAULT, 0.0};
  assert_int_equal(supine_basis_pose(basis, &asked, &pose, NULL), SUPINE_OK);
  assert_int_equal(supine_basis_weights(basis, g, pose.weights), SUPINE_ERROR_UNSUPPORTED);
  supine_basis_close(basis);
  free(bytes.data);
  supine_fields_free(&fields);
}

TEST(test_fields_of_one_direction_and_volume_twice_refused) {
  supine_fields fields = simulate(DIRECTIONS, 1);
  supine_fit fit = {.fields = NULL};
  supine_error error;
  memcpy(fields.directions + 3, fields.directions, 3 * sizeof(double));
  assert_int_equal(supine_fields_fit(&fields, &lungs, -1, &fit, &error), SUPINE_ERROR_FORMAT);
  assert_non_null(strstr(error.message, "rows 0 and 1 have the same direction of gravity"));
  supine_fields_fit_free(&fit);
  supine_fields_free(&fields);
}
