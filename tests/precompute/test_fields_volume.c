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

/* Widen every lung in every run, by a part of its size. */
static void widen(supine_fields *fields, double part) {
  const size_t n = fields->vertex_count;
  for (size_t i = 0; i < n * fields->run_count; ++i) {
    const size_t vertex = i % n;
    const size_t lung = lungs.lung_count == 2 && vertex >= lungs.lung_begin[1];
    for (size_t axis = 0; axis < 3; ++axis) {
      const double centre = 0.5 * (lungs.low[lung][axis] + lungs.high[lung][axis]);
      fields->displacement[3 * i + axis] +=
          part * (lungs.mesh.vertices[3 * vertex + axis] - centre);
    }
  }
}

/* Make the file of a basis of fields in memory.
 * @param scan_gravity  of the scan, or NULL
 * @param named         volumes at rest and at full inflation, or NULL */
static supine_status make_bytes(const supine_fields *fields, supine_warp_storage storage,
                                const double *scan_gravity, const supine_named_volumes *named,
                                supine_bytes *bytes, supine_basis_report *report,
                                supine_error *error) {
  supine_prepared prepared = {.fit = "", .source = {.lungs = lungs}};
  prepared.model.share[0] = prepared.model.share[1] = 1.0;
  if (named != NULL) {
    prepared.named = *named;
  }
  const supine_basis_choice choice = {.modes = 16,
                                      .fields = fields,
                                      .choose_band = true,
                                      .storage = storage,
                                      .scan_gravity = scan_gravity,
                                      .without_normals = true};
  return supine_precompute(&prepared, &choice, bytes, report, error);
}

static supine_basis *open_bytes(const supine_bytes *bytes) {
  supine_basis *basis = NULL;
  supine_error error = {0};
  if (supine_basis_open_memory(bytes->data, bytes->size, &basis, &error) != SUPINE_OK) {
    fail_msg("%s", error.message);
  }
  return basis;
}

/* Make a basis of fields in memory. */
static supine_basis *make(const supine_fields *fields, supine_warp_storage storage,
                          supine_bytes *bytes, supine_basis_report *report) {
  supine_error error = {0};
  if (make_bytes(fields, storage, NULL, NULL, bytes, report, &error) != SUPINE_OK) {
    fail_msg("%s", error.message);
  }
  return open_bytes(bytes);
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

static int compare_numbers(const void *first, const void *second) {
  const double *a = first;
  const double *b = second;
  return (*a > *b) - (*a < *b);
}

/* Assert that the stored error of a vertex is 1 to 3 times the found one, in the median.
 * @param square  [vertices] sums over `states` of the squared error, mm^2; overwritten */
static void check_vertices(const supine_basis *basis, double *square, size_t states) {
  const size_t n = lungs.mesh.vertex_count;
  const float *stored = supine_basis_tensor(basis, "error_vertices")->data;
  for (size_t i = 0; i < n; ++i) {
    square[i] = (double)stored[i] / sqrt(square[i] / (double)states);
  }
  qsort(square, n, sizeof *square, compare_numbers);
  print_message("stored error of a vertex / found: median %.2f, 5 %% %.2f, 95 %% %.2f\n",
                square[n / 2], square[n / 20], square[n - 1 - n / 20]);
  assert_true(square[n / 2] > 1.0 && square[n / 2] < 3.0);
}

/* Assert that stored errors in gaps between directions follow the volume as displace() does: what a
 * fit misses of its functions of gravity is multiplied by 1 - 0.6 s. */
static void check_volume_factors(const supine_basis *basis) {
  const supine_tensor *stored = supine_basis_tensor(basis, "error_volume");
  const double *factor = stored->data;
  assert_int_equal(stored->shape[0], VOLUMES);
  for (size_t k = 1; k < VOLUMES; ++k) {
    const double expected = 1.0 - 0.6 * (double)k / (VOLUMES - 1.0);
    assert_close(sqrt(factor[k] / factor[0]), expected, 0.03);
  }
}

/* Assert that states which were not simulated come back within `limit`, relative RMS, with the
 * volumes that were asked. */
static void check_states(const supine_basis *basis, double limit) {
  const size_t n = lungs.mesh.vertex_count;
  float *xyz = malloc(3 * n * sizeof *xyz);
  double *square = calloc(n, sizeof *square);
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
        square[i] += (moved - u[axis]) * (moved - u[axis]);
        size2 += u[axis] * u[axis];
      }
    }
  }
  check_vertices(basis, square, 10);
  free(square);
  free(xyz);
  assert_true(sqrt(error2 / size2) < limit);
}

static void check_storage(supine_warp_storage storage, bool clusters) {
  supine_fields fields = simulate(DIRECTIONS, VOLUMES);
  supine_bytes bytes = {.data = NULL};
  supine_basis_report report;
  supine_basis *basis = make(&fields, storage, &bytes, &report);
  assert_int_equal(supine_basis_get_info(basis)->cluster_count > 0, clusters);
  assert_int_equal(supine_basis_get_info(basis)->order,
                   3); /* which three volumes do not determine */
  assert_true(report.fit.between > 0.0);
  assert_int_equal(report.fit.volume_count, VOLUMES);
  assert_true(report.accuracy.relative_rms < 0.01 && report.accuracy.relative_rms > 1e-4);
  check_states(basis, 2.0 * report.accuracy.relative_rms);
  check_volume_factors(basis);
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
  assert_non_null(strstr(error.message, "choose a volume in this range"));
  asked.volume = (supine_volume){SUPINE_VOLUME_REST, 0.0};
  assert_int_equal(supine_basis_pose(basis, &asked, &pose, &error), SUPINE_ERROR_ARGUMENT);
  asked.volume = (supine_volume){SUPINE_VOLUME_DEFAULT, 0.0};
  assert_int_equal(supine_basis_pose(basis, &asked, &pose, NULL), SUPINE_OK);
  assert_int_equal(supine_basis_weights(basis, g, pose.weights), SUPINE_ERROR_UNSUPPORTED);
  supine_basis_close(basis);
  free(bytes.data);
  supine_fields_free(&fields);
}

/* Assert that the lungs together hold a volume in a state, and return its pose. */
static supine_pose hold(const supine_basis *basis, supine_state state, double total) {
  double held[SUPINE_LUNGS_MAX];
  supine_pose pose;
  supine_error error = {0};
  if (supine_basis_pose(basis, &state, &pose, &error) != SUPINE_OK) {
    fail_msg("%s", error.message);
  }
  assert_int_equal(supine_basis_volumes(basis, &pose, held), SUPINE_OK);
  assert_close(held[0] + held[1], total, 1e-2);
  return pose;
}

TEST(test_fields_over_volume_rest_and_full_named) {
  supine_fields fields = simulate(DIRECTIONS, VOLUMES);
  supine_bytes bytes = {.data = NULL};
  supine_basis_report report;
  supine_error error;
  const double scan = lungs.volume[0] + lungs.volume[1];
  const double oblique[3] = {0.48, 0.6, -0.64};
  supine_named_volumes named = {.has_rest = true, .full = 1.35 * scan};
  for (size_t axis = 0; axis < 6; ++axis) {
    named.rest[axis] = (1.12 + 0.01 * (double)axis) * scan;
  }
  assert_int_equal(
      make_bytes(&fields, SUPINE_FIELD_STORAGE_MODES, NULL, &named, &bytes, &report, &error),
      SUPINE_OK);
  supine_basis *basis = open_bytes(&bytes);
  const supine_basis_info *info = supine_basis_get_info(basis);
  assert_true(info->has_rest && info->has_full);
  for (size_t axis = 0; axis < 6; ++axis) {
    supine_state at = {.volume = {SUPINE_VOLUME_REST, 0.0}};
    at.gravity[axis / 2] = axis % 2 == 0 ? 1.0 : -1.0;
    (void)hold(basis, at, named.rest[axis]);
    at.volume.kind = SUPINE_VOLUME_DEFAULT;
    (void)hold(basis, at, named.rest[axis]);
    at.volume = (supine_volume){SUPINE_VOLUME_REST, 40.0};
    (void)hold(basis, at, named.rest[axis] + 40.0);
  }
  supine_state at = {.gravity = {oblique[0], oblique[1], oblique[2]},
                     .volume = {SUPINE_VOLUME_FULL, -50.0}};
  (void)hold(basis, at, named.full - 50.0);
  supine_basis_close(basis);
  free(bytes.data);
  bytes = (supine_bytes){.data = NULL};
  named.rest[3] = 3.0 * scan;
  assert_int_equal(
      make_bytes(&fields, SUPINE_FIELD_STORAGE_MODES, NULL, &named, &bytes, &report, &error),
      SUPINE_ERROR_NUMERICAL);
  assert_non_null(strstr(error.message, "volumes at rest"));
  assert_non_null(strstr(error.message, "prone"));
  free(bytes.data);
  supine_fields_free(&fields);
}

TEST(test_fields_of_gravity_alone_named_volumes_refused) {
  supine_fields fields = simulate(DIRECTIONS, 1);
  supine_bytes bytes = {.data = NULL};
  supine_basis_report report;
  supine_error error;
  const supine_named_volumes named = {.full = 5000.0};
  assert_int_equal(
      make_bytes(&fields, SUPINE_FIELD_STORAGE_MODES, NULL, &named, &bytes, &report, &error),
      SUPINE_ERROR_ARGUMENT);
  assert_non_null(strstr(error.message, "one volume for each direction"));
  free(bytes.data);
  supine_fields_free(&fields);
}

/* The surface shows prone lungs: in this posture and at its volumes it stays, and other states are
 * displaced from there. */
TEST(test_fields_over_volume_scanned_posture_keeps_surface) {
  static const double prone[3] = {0.0, -1.0, 0.0};
  const size_t n = lungs.mesh.vertex_count;
  supine_fields fields = simulate(DIRECTIONS, VOLUMES);
  supine_bytes bytes = {.data = NULL};
  supine_basis_report report;
  supine_error error = {0};
  float *xyz = malloc(3 * n * sizeof *xyz);
  widen(&fields, -0.05); /* the volume of the scan is inside the range */
  if (make_bytes(&fields, SUPINE_FIELD_STORAGE_MODES, prone, NULL, &bytes, &report, &error) !=
      SUPINE_OK) {
    fail_msg("%s", error.message);
  }
  supine_basis *basis = open_bytes(&bytes);
  const double scan = lungs.volume[0] + lungs.volume[1];
  for (size_t flip = 0; flip < 2; ++flip) {
    const supine_state at = {.gravity = {0.0, flip == 0 ? -1.0 : 1.0, 0.0},
                             .volume = {SUPINE_VOLUME_SCAN, 0.0}};
    const supine_pose pose = hold(basis, at, scan);
    double square = 0.0;
    assert_int_equal(supine_deform(basis, &pose, xyz), SUPINE_OK);
    for (size_t i = 0; i < 3 * n; ++i) {
      const double moved = (double)xyz[i] - lungs.mesh.vertices[i];
      square += moved * moved;
    }
    const double rms = sqrt(square / (double)n);
    assert_true(flip == 0 ? rms < 2.0 * report.accuracy.rms_mm : rms > 5.0);
  }
  supine_pose scanned;
  assert_int_equal(supine_basis_scan_pose(basis, &scanned, NULL), SUPINE_OK);
  assert_int_equal(supine_deform(basis, &scanned, xyz), SUPINE_OK);
  for (size_t i = 0; i < 3 * n; ++i) {
    assert_close((double)xyz[i], lungs.mesh.vertices[i], 1e-2);
  }
  supine_basis_close(basis);
  free(bytes.data);
  free(xyz);
  supine_fields_free(&fields);
}

/* A smallest volume above that of the scan: the default is the middle of what was simulated. */
TEST(test_fields_over_volume_scan_not_simulated_middle_is_default) {
  supine_fields fields = simulate(DIRECTIONS, VOLUMES);
  supine_bytes bytes = {.data = NULL};
  supine_basis_report report;
  supine_error error;
  const double prone[3] = {0.0, -1.0, 0.0};
  widen(&fields, 0.2); /* no lung holds its own volume in any run */
  supine_basis *basis = make(&fields, SUPINE_FIELD_STORAGE_MODES, &bytes, &report);
  const supine_volume usual = supine_basis_default_volume(basis);
  supine_state at = {.gravity = {0.0, -1.0, 0.0}, .volume = {SUPINE_VOLUME_DEFAULT, 0.0}};
  supine_pose scanned;
  assert_int_equal(usual.kind, SUPINE_VOLUME_ABSOLUTE);
  assert_true(usual.ml > 1.1 * (lungs.volume[0] + lungs.volume[1]));
  (void)hold(basis, at, usual.ml);
  assert_int_equal(supine_basis_scan_pose(basis, &scanned, NULL), SUPINE_OK);
  supine_basis_close(basis);
  free(bytes.data);
  bytes = (supine_bytes){.data = NULL};
  assert_int_equal(
      make_bytes(&fields, SUPINE_FIELD_STORAGE_MODES, prone, NULL, &bytes, &report, &error),
      SUPINE_ERROR_ARGUMENT);
  assert_non_null(strstr(error.message, "in the posture of the scan"));
  free(bytes.data);
  supine_fields_free(&fields);
}

/* Without full inflation, shares of it say nothing, and mL give the other postures too. */
TEST(test_prepare_fields_rest_in_ml_or_share_of_full) {
  const supine_precompute_surface surface = {.vertex_count = lungs.mesh.vertex_count,
                                             .vertices = lungs.mesh.vertices,
                                             .triangle_count = lungs.mesh.triangle_count,
                                             .triangles = lungs.mesh.triangles};
  supine_precompute_options options = {.size = sizeof options,
                                       .lungs = {.surfaces = &surface, .surface_count = 1},
                                       .fields = "none.safetensors"};
  supine_error error;
  for (int step = 0; step < 3; ++step) {
    SUPINE_FREED_BY(supine_precompute_prepared_free) supine_prepared prepared = {.fit = ""};
    supine_precompute_rest *rest = &options.volumes.rest[SUPINE_REST_SUPINE];
    rest->ml = step == 0 ? 2400.0 : 0.0;
    rest->share[0] = step == 0 ? 0.0 : 0.5;
    options.volumes.full = step == 2 ? 5200.0 : 0.0;
    const supine_status status = supine_precompute_prepare(&options, &prepared, &error);
    if (step == 1) {
      assert_int_equal(status, SUPINE_ERROR_ARGUMENT);
      assert_non_null(strstr(error.message, "a share of full inflation, which is unknown"));
    } else {
      const double supine = step == 0 ? 2400.0 : 2600.0;
      assert_int_equal(status, SUPINE_OK);
      assert_true(prepared.named.has_rest);
      assert_true(fabs(prepared.named.rest[SUPINE_REST_SUPINE] - supine) < 0.02 * supine);
      assert_true(prepared.named.rest[SUPINE_REST_UPRIGHT] > 1.05 * supine);
      assert_close(prepared.named.full, options.volumes.full, 1e-9);
    }
  }
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

/* Let the left lung open late, and the range of both depend on the cube of a direction. */
static void open_late(const double g[3], double s, size_t vertex, double u[3]) {
  const size_t lung = lungs.lung_count == 2 && vertex >= lungs.lung_begin[1];
  const double late = 1.15 * s * s * s / (s * s * s + 0.15);
  const double filled =
      (lung == 0 ? late : s) * (1.0 + 0.12 * g[1] * g[1] * g[1]) + 0.06 * g[1] * g[1] * g[1];
  displace(g, 0.0, vertex, u);
  for (size_t i = 0; i < 3; ++i) {
    const double centre = 0.5 * (lungs.low[lung][i] + lungs.high[lung][i]);
    u[i] += 0.14 * filled * (lungs.mesh.vertices[3 * vertex + i] - centre);
  }
}

/* Move the lungs by open_late. Write the displacement of each vertex, if `u` is given, and the
 * volume of each lung, mL. */
static void move_late(const double g[3], double s, double *u, double volume[2]) {
  const size_t n = lungs.mesh.vertex_count;
  double *moved = malloc(3 * n * sizeof *moved);
  for (size_t i = 0; i < n; ++i) {
    double own[3];
    open_late(g, s, i, own);
    for (size_t k = 0; k < 3; ++k) {
      moved[3 * i + k] = lungs.mesh.vertices[3 * i + k] + own[k];
    }
    if (u != NULL) {
      memcpy(u + 3 * i, own, sizeof own);
    }
  }
  for (size_t lung = 0; lung < lungs.lung_count; ++lung) {
    supine_mesh part = supine_lungs_part(&lungs, lung);
    part.vertices = moved;
    volume[lung] = 1e-3 * supine_mesh_volume(&part);
  }
  free(moved);
}

/* Return the status of a pose in which each lung has a volume, mL, and say why it is refused. */
static supine_status pose_with(const supine_basis *basis, const double g[3], double left,
                               double right, supine_error *error) {
  supine_pose pose;
  supine_state asked = {.gravity = {g[0], g[1], g[2]}, .lung_count = 2};
  asked.lungs[0].volume = (supine_volume){SUPINE_VOLUME_ABSOLUTE, left};
  asked.lungs[1].volume = (supine_volume){SUPINE_VOLUME_ABSOLUTE, right};
  (void)strcpy(asked.lungs[0].name, "left");
  (void)strcpy(asked.lungs[1].name, "right");
  return supine_basis_pose(basis, &asked, &pose, error);
}

TEST(test_fields_over_volume_limits_are_those_that_were_simulated) {
  enum { EACH = 6, COUNT = 24 * EACH, OTHERS = 60 };
  const size_t n = lungs.mesh.vertex_count;
  supine_fields fields = simulate(24, EACH);
  supine_bytes bytes = {.data = NULL};
  supine_basis_report report;
  double(*held)[2] = malloc(COUNT * sizeof *held);
  for (size_t run = 0; run < COUNT; ++run) {
    move_late(fields.directions + 3 * run, (double)(run % EACH) / (EACH - 1),
              fields.displacement + 3 * n * run, held[run]);
  }
  supine_basis *basis = make(&fields, SUPINE_FIELD_STORAGE_BEST, &bytes, &report);
  for (size_t run = 0; run < COUNT; ++run) {
    const double *g = fields.directions + 3 * run;
    const size_t first = run - run % EACH;
    const double range = held[first + EACH - 1][0] - held[first][0];
    supine_error error = {.message = ""};
    if (pose_with(basis, g, held[run][0], held[run][1], &error) != SUPINE_OK) {
      fail_msg("run %zu: %s", run, error.message);
    }
    if (run % EACH == 0 || run % EACH == EACH - 1) {
      const double beyond = held[run][0] + (run % EACH == 0 ? -0.03 : 0.03) * range;
      assert_int_equal(pose_with(basis, g, beyond, held[run][1], &error), SUPINE_ERROR_NUMERICAL);
    }
  }
  for (size_t k = 0; k < OTHERS; ++k) { /* between the directions and the volumes */
    double g[3];
    double volume[2];
    supine_error error = {.message = ""};
    supine_spiral((double)k, OTHERS, 0.3, g);
    move_late(g, 0.05 + 0.9 * (double)(7 * k % OTHERS) / OTHERS, NULL, volume);
    if (pose_with(basis, g, volume[0], volume[1], &error) != SUPINE_OK) {
      fail_msg("state %zu inside the range: %s", k, error.message);
    }
  }
  supine_basis_close(basis);
  free(bytes.data);
  free(held);
  supine_fields_free(&fields);
}
