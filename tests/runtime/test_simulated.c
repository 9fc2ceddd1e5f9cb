/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Pose bases of fields over gravity and volume. The volumes of the lungs of
 * fixture_create_simulated are known functions of their weights. */
#include "tests/helpers/test.h"

#include <supine/locate.h>
#include <supine/runtime.h>

#include "tests/helpers/runtime_fixture.h"

static const double constant = 1 / 0.28209479177387814; /* Y(0, 0) times this is 1 */

/* Gravity in these tests, of the length 1. */
static const double oblique[3] = {0.48, 0.6, -0.64};

static fixture *f;
static unsigned char *bytes;
static supine_basis *basis;
static const supine_basis_info *info;
static double reference[2]; /* volumes of the lungs, mL */

/* Close the basis, and open that of the changed fixture. */
static void open_again(void) {
  size_t size = 0;
  supine_error error = {0};
  supine_basis_close(basis);
  free(bytes);
  bytes = fixture_bytes(f, &size);
  if (supine_basis_open_memory(bytes, size, &basis, &error) != SUPINE_OK) {
    fail_msg("%s", error.message);
  }
  info = supine_basis_get_info(basis);
  memcpy(reference, info->reference_volume, sizeof reference);
}

/* Make the basis of one test. */
static void begin(void) {
  f = fixture_create_simulated(60, 91);
  open_again();
}

static void end(void) {
  supine_basis_close(basis);
  free(bytes);
  fixture_destroy(f);
  basis = NULL;
  bytes = NULL;
}

/* Return a state of all lungs. */
static supine_state state_of(const double gravity[3], supine_volume_kind kind, double ml) {
  return (supine_state){.gravity = {gravity[0], gravity[1], gravity[2]}, .volume = {kind, ml}};
}

/* Return a state that names both lungs, the second first. */
static supine_state named(supine_volume_kind kind, double first, double second) {
  supine_state state = state_of(oblique, SUPINE_VOLUME_DEFAULT, 0);
  state.lung_count = 2;
  (void)strcpy(state.lungs[0].name, "1");
  (void)strcpy(state.lungs[1].name, "0");
  state.lungs[0].volume = (supine_volume){kind, second};
  state.lungs[1].volume = (supine_volume){kind, first};
  return state;
}

/* Pose a state that must be accepted. Write the volumes of the lungs, and assert that the weights
 * are those at which the lungs hold them. */
static supine_pose pose_of(const supine_state *state, double volumes[2]) {
  supine_pose pose;
  supine_error error = {0};
  if (supine_basis_pose(basis, state, &pose, &error) != SUPINE_OK) {
    fail_msg("%s", error.message);
  }
  assert_int_equal(supine_basis_volumes(basis, &pose, volumes), SUPINE_OK);
  const double *g = state->gravity;
  const double y = g[1] / sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2]);
  for (size_t lung = 0; lung < 2; ++lung) {
    const double *w = supine_basis_lung_weights(basis, &pose, lung);
    const double t = w[0] / 0.1;
    const double held = reference[lung] * pow(1 + w[0], 3);
    assert_true(fabs(volumes[lung] - held) < 1e-3); /* vertices are floats */
    assert_true(fabs(w[1] - y * (0.2 + 0.05 * (2 * t * t - 1))) < 1e-12);
    for (size_t axis = 0; axis < 3; ++axis) {
      assert_true(pose.gains[lung][axis] == 1);
    }
  }
  return pose;
}

static void assert_pose_refused(const supine_state *state, supine_status status,
                                const char *reason) {
  supine_pose pose = {.basis = 0};
  supine_error error = {0};
  assert_int_equal(supine_basis_pose(basis, state, &pose, &error), status);
  assert_says(error.message, reason);
}

/* Write the changed fixture, and assert that it is refused for this reason. */
static void assert_refused(const char *reason) {
  size_t size = 0;
  unsigned char *changed = fixture_bytes(f, &size);
  supine_basis *refused = NULL;
  supine_error error = {0};
  assert_int_equal(supine_basis_open_memory(changed, size, &refused, &error), SUPINE_ERROR_FORMAT);
  assert_null(refused);
  assert_says(error.message, reason);
  free(changed);
}

TEST(test_pose_simulated_total_volume_held) {
  begin();
  const double all = reference[0] + reference[1];
  assert_int_equal(info->order, 2);
  assert_true(info->is_fields && info->has_volume && !info->has_rest && !info->has_full);
  uint64_t random = 3;
  for (int trial = 0; trial < 200; ++trial) {
    const double gravity[3] = {fixture_random(&random), fixture_random(&random),
                               3 * fixture_random(&random)};
    const double volume = all * (1 + 0.18 * fixture_random(&random));
    const supine_state kinds[2] = {state_of(gravity, SUPINE_VOLUME_ABSOLUTE, volume),
                                   state_of(gravity, SUPINE_VOLUME_SCAN, volume - all)};
    for (size_t i = 0; i < 2; ++i) {
      double held[2];
      (void)pose_of(&kinds[i], held);
      assert_true(fabs(held[0] + held[1] - volume) <= 2e-6); /* each lung within 1e-6 mL */
    }
  }
  end();
}

/* The lungs share a volume as the simulator said: 0.22 and 0.28 times their reference volumes for
 * half of the simulated range. */
TEST(test_pose_simulated_total_volume_shared_as_simulated) {
  begin();
  const double want[2] = {0.22 * reference[0], 0.28 * reference[1]};
  const double half = 0.25 * (reference[0] + reference[1]);
  for (int percent = -60; percent <= 60; percent += 20) {
    const double part = 0.01 * percent;
    const supine_state asked = state_of(oblique, SUPINE_VOLUME_SCAN, part * half);
    const double left = part * (half - want[0] - want[1]); /* goes to the first lung */
    double held[2];
    (void)pose_of(&asked, held);
    assert_true(fabs(held[0] - reference[0] - part * want[0] - left) <= 1e-5);
    assert_true(fabs(held[1] - reference[1] - part * want[1]) <= 1e-5);
  }
  end();
}

/* A lung at its limit passes the rest of a total volume on. */
TEST(test_pose_simulated_lung_at_limit_other_takes_rest) {
  begin();
  const double limit = reference[1] * (0.2 + 0.02 * oblique[1]);
  const double total = (reference[0] + reference[1]) * 0.205;
  const supine_state asked = state_of(oblique, SUPINE_VOLUME_SCAN, total);
  double held[2];
  (void)pose_of(&asked, held);
  assert_true(fabs(held[1] - reference[1] - limit) <= 1e-5);
  assert_true(fabs(held[0] - reference[0] - (total - limit)) <= 1e-5);
  end();
}

TEST(test_pose_simulated_named_lungs_hold_their_volumes) {
  begin();
  const double ml[2] = {reference[0] * 1.13, reference[1] * 0.87};
  const supine_state absolute = named(SUPINE_VOLUME_ABSOLUTE, ml[0], ml[1]);
  const supine_state scan = named(SUPINE_VOLUME_SCAN, ml[0] - reference[0], ml[1] - reference[1]);
  const supine_state *const states[] = {&absolute, &scan};
  for (size_t i = 0; i < 2; ++i) {
    double held[2];
    (void)pose_of(states[i], held);
    assert_true(fabs(held[0] - ml[0]) <= 1.001e-6);
    assert_true(fabs(held[1] - ml[1]) <= 1.001e-6);
  }
  end();
}

TEST(test_pose_simulated_wrong_lungs_refused) {
  begin();
  supine_state asked = named(SUPINE_VOLUME_SCAN, 10, 10);
  (void)strcpy(asked.lungs[1].name, "1");
  assert_pose_refused(&asked, SUPINE_ERROR_ARGUMENT, "lung '1' is unknown or named twice");
  (void)strcpy(asked.lungs[1].name, "heart");
  assert_pose_refused(&asked, SUPINE_ERROR_ARGUMENT, "lung 'heart' is unknown");
  asked.lung_count = 1;
  assert_pose_refused(&asked, SUPINE_ERROR_ARGUMENT, "not all 2 lungs are named");
  end();
}

TEST(test_pose_simulated_outside_range_refused_with_range) {
  begin();
  char range[128];
  const double all = reference[0] + reference[1];
  const double low = all * (0.8 + 0.02 * oblique[1]);
  const double high = all * (1.2 + 0.02 * oblique[1]);
  /* The limits of the file are 1 % of the simulated range outside it. */
  const double wider = (high - low) / 102;
  (void)snprintf(range, sizeof range, "the lungs were simulated at %.0f to %.0f mL", low + wider,
                 high - wider);
  const double wrong[] = {low - 1, high + 1, -1e9, 1e14};
  for (size_t i = 0; i < sizeof wrong / sizeof *wrong; ++i) {
    const supine_state asked = state_of(oblique, SUPINE_VOLUME_ABSOLUTE, wrong[i]);
    assert_pose_refused(&asked, SUPINE_ERROR_NUMERICAL, range);
  }
  const supine_state endless = state_of(oblique, SUPINE_VOLUME_ABSOLUTE, 1e300);
  assert_pose_refused(&endless, SUPINE_ERROR_ARGUMENT, "above 1e+15 mL");
  double held[2];
  const supine_state lowest = state_of(oblique, SUPINE_VOLUME_ABSOLUTE, low + 1e-3);
  const supine_state highest = state_of(oblique, SUPINE_VOLUME_ABSOLUTE, high - 1e-3);
  (void)pose_of(&lowest, held);
  (void)pose_of(&highest, held);
  (void)snprintf(range, sizeof range, "lung 1 was simulated at %.0f to %.0f mL",
                 reference[1] * (0.8 + 0.02 * oblique[1] + 0.4 / 102),
                 reference[1] * (1.2 + 0.02 * oblique[1] - 0.4 / 102));
  const supine_state one = named(SUPINE_VOLUME_ABSOLUTE, reference[0], reference[1] * 1.3);
  assert_pose_refused(&one, SUPINE_ERROR_NUMERICAL, range);
  end();
}

TEST(test_pose_simulated_default_volume_is_that_of_scan) {
  begin();
  double held[2];
  const supine_state asked = state_of(oblique, SUPINE_VOLUME_DEFAULT, 0);
  const supine_volume volume = supine_basis_default_volume(basis);
  assert_true(volume.kind == SUPINE_VOLUME_SCAN && volume.ml == 0);
  (void)pose_of(&asked, held);
  assert_true(fabs(held[0] - reference[0]) <= 1.001e-6);
  assert_true(fabs(held[1] - reference[1]) <= 1.001e-6);
  end();
}

/* If the volume in the scan was not simulated in all postures, the default is the middle of the
 * totals that were. */
TEST(test_pose_simulated_default_volume_outside_range_is_middle) {
  begin();
  double held[2];
  const supine_state asked = state_of(oblique, SUPINE_VOLUME_DEFAULT, 0);
  f->limits[1][0][0] = 0.1 * reference[1] * constant;
  open_again();
  const double low = 0.82 * reference[0] + 1.12 * reference[1]; /* where g_y is 1 */
  const double high = 1.18 * (reference[0] + reference[1]);     /* where g_y is -1 */
  const supine_volume volume = supine_basis_default_volume(basis);
  assert_true(volume.kind == SUPINE_VOLUME_ABSOLUTE);
  assert_true(fabs(volume.ml - 0.5 * (low + high)) <= 0.5 + 1e-6 * high);
  (void)pose_of(&asked, held);
  assert_true(fabs(held[0] + held[1] - volume.ml) <= 2e-6);
  end();
}

TEST(test_pose_simulated_rest_and_full_need_tensors) {
  begin();
  double resting[18] = {0};
  double full[18] = {0};
  double held[2];
  const supine_state rest = state_of(oblique, SUPINE_VOLUME_REST, 0);
  const supine_state inflated = state_of(oblique, SUPINE_VOLUME_FULL, 0);
  assert_pose_refused(&rest, SUPINE_ERROR_ARGUMENT, "do not say which volume is rest");
  assert_pose_refused(&inflated, SUPINE_ERROR_ARGUMENT,
                      "do not say which volume is full inflation");
  /* as the shares divide a part of half of the simulated range */
  const double half = 0.25 * (reference[0] + reference[1]);
  const double second = 0.28 * reference[1];
  const double at_rest[2] = {-0.4 * (half - second), -0.4 * second};
  const double at_full[2] = {0.6 * (half - second), 0.6 * second};
  for (size_t lung = 0; lung < 2; ++lung) {
    resting[9 * lung] = at_rest[lung] * constant;
    full[9 * lung] = at_full[lung] * constant;
  }
  f->resting = resting;
  f->full = full;
  open_again();
  assert_true(info->has_rest && info->has_full);
  (void)pose_of(&rest, held);
  assert_true(fabs(held[0] - reference[0] - at_rest[0]) <= 2e-6);
  assert_true(fabs(held[1] - reference[1] - at_rest[1]) <= 2e-6);
  (void)pose_of(&inflated, held);
  assert_true(fabs(held[0] - reference[0] - at_full[0]) <= 2e-6);
  assert_true(fabs(held[1] - reference[1] - at_full[1]) <= 2e-6);
  const supine_state usual = state_of(oblique, SUPINE_VOLUME_DEFAULT, 0);
  (void)pose_of(&usual, held);
  assert_true(fabs(held[0] - reference[0] - at_rest[0]) <= 2e-6);
  const supine_state breath = state_of(oblique, SUPINE_VOLUME_REST, 100);
  (void)pose_of(&breath, held);
  assert_true(fabs(held[0] + held[1] - 0.9 * (reference[0] + reference[1]) - 100) <= 3e-6);
  const supine_state by_lung = named(SUPINE_VOLUME_REST, 50, -60);
  (void)pose_of(&by_lung, held);
  assert_true(fabs(held[0] - reference[0] - at_rest[0] - 50) <= 2e-6);
  assert_true(fabs(held[1] - reference[1] - at_rest[1] + 60) <= 2e-6);
  end();
}

/* The fit gives the lungs nearly, but not exactly, their own volumes in the scan and at rest. A
 * state at these volumes is continued by those near it, and in the posture of the scan each lung
 * has its own volume. */
TEST(test_pose_simulated_volumes_near_scan_rest_and_full_do_not_jump) {
  static const double step = 1e-3; /* mL */
  static const double postures[3][3] = {{0.48, 0.6, -0.64}, {0, -1, 0}, {-0.6, 0, 0.8}};
  begin();
  double resting[18] = {0};
  double full[18] = {0};
  for (size_t lung = 0; lung < 2; ++lung) {
    const double sign = lung == 0 ? 1 : -1;
    f->shares[lung][0][0] = 0.01 * sign * reference[0] * constant;
    f->shares[lung][1][0] = 0.03 * sign * reference[0];
    f->shares[lung][2][1] = 0.02 * sign * reference[0];
    resting[9 * lung] = (lung == 0 ? -0.1 : -0.12) * reference[lung] * constant;
    full[9 * lung] = (lung == 0 ? 0.15 : 0.11) * reference[lung] * constant;
  }
  f->resting = resting;
  f->full = full;
  f->scan_gravity = "0.48,0.6,-0.64"; /* postures[0] */
  open_again();
  for (size_t trial = 0; trial < 9; ++trial) {
    static const supine_volume_kind kinds[3] = {SUPINE_VOLUME_SCAN, SUPINE_VOLUME_REST,
                                                SUPINE_VOLUME_FULL};
    const supine_state at = state_of(postures[trial / 3], kinds[trial % 3], 0);
    const supine_state near = state_of(postures[trial / 3], kinds[trial % 3], step);
    double held[2][2];
    (void)pose_of(&at, held[0]);
    (void)pose_of(&near, held[1]);
    for (size_t lung = 0; lung < 2; ++lung) {
      assert_true(fabs(held[1][lung] - held[0][lung]) <= step + 4e-6);
      if (trial == 0) {
        assert_true(fabs(held[0][lung] - reference[lung]) <= 1.001e-6);
      }
    }
  }
  f->scan_gravity = "0,0,0";
  assert_refused("metadata 'scan_gravity' is not a direction");
  end();
}

TEST(test_pose_simulated_wrong_state_refused) {
  begin();
  const double none[3] = {0, 0, 0};
  const supine_state fallen = state_of(none, SUPINE_VOLUME_SCAN, 0);
  assert_pose_refused(&fallen, SUPINE_ERROR_ARGUMENT, "gravity is zero");
  const supine_state unknown = state_of(oblique, SUPINE_VOLUME_KIND_COUNT, 0);
  assert_pose_refused(&unknown, SUPINE_ERROR_ARGUMENT, "volume kind 5");
  const supine_state infinite = state_of(oblique, SUPINE_VOLUME_SCAN, (double)NAN);
  assert_pose_refused(&infinite, SUPINE_ERROR_ARGUMENT, "not finite");
  end();
}

/* Each lung moves by its own weights. */
TEST(test_deform_simulated_each_lung_by_its_weights) {
  begin();
  const supine_state asked = named(SUPINE_VOLUME_ABSOLUTE, reference[0] * 1.15, reference[1] * 0.9);
  double held[2];
  float xyz[180];
  float half[180];
  const supine_pose pose = pose_of(&asked, held);
  assert_int_equal(supine_deform(basis, &pose, xyz), SUPINE_OK);
  assert_int_equal(supine_deform_range(basis, &pose, 20, 45, half), SUPINE_OK);
  assert_memory_equal(half, xyz + 60, 75 * sizeof *half);
  const double error = supine_basis_error(basis, &pose);
  assert_true(error <= 0.0101);
  for (size_t i = 0; i < 60; ++i) {
    const double *w = supine_basis_lung_weights(basis, &pose, f->lung[i]);
    for (size_t axis = 0; axis < 3; ++axis) {
      const float *c = f->coefficient + (3 * i + axis) * 2;
      const double want =
          (double)f->vertex[3 * i + axis] + w[0] * (double)c[0] + w[1] * (double)c[1];
      assert_true(fabs((double)xyz[3 * i + axis] - want) <= error);
    }
  }
  end();
}

/* The function for one weight of each mode says that it does not support this basis. */
TEST(test_weights_simulated_unsupported) {
  begin();
  double weights[2];
  assert_int_equal(supine_basis_weights(basis, oblique, weights), SUPINE_ERROR_UNSUPPORTED);
  end();
}

/* The uniforms of supine.glsl are the weights of each lung, padded to vec4s. */
TEST(test_gl_weights_simulated_each_lung_padded) {
  begin();
  const supine_state asked = named(SUPINE_VOLUME_SCAN, -10, 10);
  supine_pose pose;
  float weights[8];
  float gains[6];
  assert_int_equal(supine_basis_pose(basis, &asked, &pose, NULL), SUPINE_OK);
  assert_int_equal(supine_gl_weights(basis, &pose, weights, gains), SUPINE_OK);
  for (size_t lung = 0; lung < 2; ++lung) {
    const double *own = supine_basis_lung_weights(basis, &pose, lung);
    const float want[4] = {(float)own[0], (float)own[1], 0, 0};
    assert_memory_equal(weights + 4 * lung, want, sizeof want);
  }
  assert_true(weights[0] < weights[4]);
  end();
}

/* In the scan the lungs have the reference surface, as displacements count from it. */
TEST(test_scan_pose_simulated_is_reference_surface) {
  begin();
  supine_pose pose;
  float xyz[3 * 60];
  assert_int_equal(supine_basis_scan_pose(basis, &pose, NULL), SUPINE_OK);
  assert_int_equal(supine_deform(basis, &pose, xyz), SUPINE_OK);
  for (size_t i = 0; i < 3 * 60; ++i) {
    assert_true(fabs((double)xyz[i] - (double)f->vertex[i]) <= supine_basis_error(basis, &pose));
  }
  end();
}

/* Observed points tell a volume that is not given, in the range that was simulated. */
TEST(test_locate_simulated_volume_found) {
  enum { POINTS = 20 };
  begin();
  const double all = reference[0] + reference[1];
  for (int side = -1; side <= 1; side += 2) {
    const supine_state held = state_of(oblique, SUPINE_VOLUME_ABSOLUTE, (1 + 0.1 * side) * all);
    supine_observation observed[POINTS];
    supine_locate_residual residuals[POINTS];
    const supine_location *found = NULL;
    float xyz[3 * 60];
    supine_pose pose;
    supine_error error = {0};
    assert_int_equal(supine_basis_pose(basis, &held, &pose, NULL), SUPINE_OK);
    assert_int_equal(supine_deform(basis, &pose, xyz), SUPINE_OK);
    for (size_t j = 0; j < POINTS; ++j) {
      const float *at = xyz + 9 * j;
      observed[j] = (supine_observation){.vertex = 3 * j, .noise = 1};
      for (size_t axis = 0; axis < 3; ++axis) {
        observed[j].position[axis] = (double)at[axis];
      }
    }
    const supine_locate_task task = {.inside = basis,
                                     .state = state_of(oblique, SUPINE_VOLUME_DEFAULT, 0),
                                     .observed = observed,
                                     .count = POINTS};
    double *space = fixture_allocate(supine_locate_space(POINTS), sizeof *space);
    if (supine_locate(&task, residuals, space, &found, &error) != SUPINE_OK) {
      fail_msg("%s", error.message);
    }
    const supine_location_info *fit = supine_location_get_info(found);
    assert_true(fabs(fit->volume - (1 + 0.1 * side) * all) < fit->volume_error);
    assert_true(side * (fit->volume - all) > 0.03 * all);
    free(space);
  }
  end();
}

/* Totals at the ends of the range are accepted, although their shares are rounded. */
TEST(test_total_at_ends_of_range_accepted) {
  begin();
  for (int i = 0; i < 500; ++i) {
    const double angle = 0.0123 * i;
    const double g[3] = {sin(angle), cos(angle), 0};
    for (int side = -1; side <= 1; side += 2) {
      const double part = 1 + 0.2 * side + 0.02 * g[1];
      const double total = part * (reference[0] + reference[1]);
      const supine_state asked = state_of(g, SUPINE_VOLUME_ABSOLUTE, total);
      supine_pose pose;
      supine_error error;
      if (supine_basis_pose(basis, &asked, &pose, &error) != SUPINE_OK) {
        fail_msg("%s", error.message);
      }
    }
  }
  end();
}

TEST(test_open_wrong_simulated_volumes_refused_with_reason) {
  begin();
  const double low = f->range[1][0];
  f->range[1][0] = f->range[1][1];
  assert_refused("the simulated volumes have no range");
  f->range[1][0] = low;
  const double first = f->total[0];
  f->total[0] = f->total[1];
  assert_refused("the simulated volumes have no range");
  f->total[0] = (double)NAN;
  assert_refused("metadata 'simulated_total_ml' is not a list of 2 finite numbers");
  f->total[0] = first;
  f->limits[0][1][8] = 1.05e9;
  assert_refused("a simulated volume is 1.05e+09 mL");
  f->limits[0][1][8] = 0;
  f->volume = false;
  assert_refused("the surface has no volume");
  f->volume = true;
  f->orders = 9;
  free(f->mode);
  f->mode = fixture_allocate((size_t)2 * 4 * 9, sizeof *f->mode);
  assert_refused("tensor 'modes' has 9 polynomials of the volume, not 1 to 8");
  end();
}

/* Write factors for three volumes, and assert that they multiply the square of the error along z
 * that check_error_along_gravity has written, but not that of its constant. */
static void check_error_by_volume(void) {
  static const double wrong[] = {7, -1e-9, 3};
  static const double volume[] = {7, 1, 3};
  static const double expected[] = {4.2720018726587655, 3.2015621187164243}; /* 4 and 2 between */
  float sigma[60];
  f->error_volume = volume;
  f->error_volume_count = 3;
  open_again();
  for (size_t k = 0; k < 2; ++k) {
    const double part = k == 0 ? 0.25 : 0.75;
    const double ml = f->total[0] + part * (f->total[1] - f->total[0]);
    const supine_state along = state_of((const double[3]){0, 0, -1}, SUPINE_VOLUME_SCAN, ml);
    assert_int_equal(supine_expected_error(basis, &along, NULL, sigma, NULL), SUPINE_OK);
    for (size_t i = 0; i < 60; ++i) {
      assert_true(fabs((double)sigma[i] - expected[k] * (double)f->vertex_error[i]) < 1e-5);
    }
  }
  f->error_volume_count = 1;
  assert_refused("tensor 'error_volume' has less than two numbers, or one below 0");
  f->error_volume_count = 3;
  f->error_volume = wrong;
  assert_refused("tensor 'error_volume' has less than two numbers, or one below 0");
  f->error_volume = NULL;
  open_again();
}

/* Write errors that are 1.5 times those stored, but sqrt(1.5^2 + (2 z)^2) times along z, and assert
 * that both are stated, and combined for a displacement. Y(0, 0) is sqrt(1 / (4 pi)), and Y(1, 0)
 * is sqrt(3 / (4 pi)) z; index 2. */
static void check_error_along_gravity(void) {
  enum { BAND = 1, ROWS = 2 * BAND + 4, TERMS = (BAND + 2) * (BAND + 2) };
  double harmonics[ROWS][TERMS] = {{1.5 * 3.5449077018110321}};
  float sigma[60];
  harmonics[3][2] = 2 * 2.0466534158929770;
  f->error_gravity = &harmonics[0][0];
  open_again();
  const supine_state across = state_of((const double[3]){0, 1, 0}, SUPINE_VOLUME_SCAN, 12);
  const supine_state along = state_of((const double[3]){0, 0, -1}, SUPINE_VOLUME_SCAN, 12);
  const supine_state *from[] = {NULL, &across};
  static const double factor[] = {2.5, 2.9154759474226504}; /* sqrt(2.5^2 + 1.5^2) */
  for (size_t k = 0; k < 2; ++k) {
    assert_int_equal(supine_expected_error(basis, &along, from[k], sigma, NULL), SUPINE_OK);
    for (size_t i = 0; i < 60; ++i) {
      assert_true(fabs((double)sigma[i] - factor[k] * (double)f->vertex_error[i]) < 1e-6);
    }
  }
  check_error_by_volume();
  harmonics[1][1] = NAN;
  assert_refused("tensor 'error_gravity' has a number that is not finite");
  f->error_gravity = NULL;
  open_again();
}

TEST(test_expected_error_simulated_is_stored_error) {
  begin();
  enum { N = 60 };
  float stored[N];
  float sigma[N];
  supine_error error = {0};
  const supine_state asked = state_of(oblique, SUPINE_VOLUME_SCAN, 12);
  const supine_state other = state_of(oblique, SUPINE_VOLUME_SCAN, 30);
  const supine_state scan = supine_basis_scan(basis);
  assert_int_equal(supine_expected_error(basis, &asked, NULL, sigma, &error),
                   SUPINE_ERROR_UNSUPPORTED);
  assert_true(f->vertices == N);
  for (size_t i = 0; i < N; ++i) {
    stored[i] = 0.25F + 0.01F * (float)i;
  }
  f->vertex_error = stored;
  open_again();
  const supine_state *from[] = {NULL, &scan, &other, &asked};
  static const double factor[] = {1, 1, 1.4142135623730951, 0};
  for (size_t k = 0; k < 4; ++k) {
    assert_int_equal(supine_expected_error(basis, &asked, from[k], sigma, &error), SUPINE_OK);
    for (size_t i = 0; i < N; ++i) {
      assert_true(fabs((double)sigma[i] - factor[k] * (double)stored[i]) < 1e-6);
    }
  }
  const supine_state beyond = state_of(oblique, SUPINE_VOLUME_ABSOLUTE, 9e4);
  assert_int_equal(supine_expected_error(basis, &beyond, NULL, sigma, &error),
                   SUPINE_ERROR_NUMERICAL);
  check_error_along_gravity();
  stored[7] = -1e-3F;
  assert_refused("tensor 'error_vertices' has -0.001 mm at vertex 7, below 0");
  f->vertex_error = NULL;
  end();
}

/* A pose has room for 256 weights of all lungs. */
TEST(test_open_too_many_weights_refused) {
  begin();
  fixture *many = fixture_create(60, 129, 0, 2, true, false, 1, 3);
  fixture *own = f;
  size_t size = 0;
  unsigned char *copy = fixture_bytes(many, &size);
  supine_basis *opened = NULL;
  assert_int_equal(supine_basis_open_memory(copy, size, &opened, NULL), SUPINE_OK);
  supine_basis_close(opened);
  free(copy);
  free(many->mode);
  many->orders = 2;
  many->mode = fixture_allocate((size_t)129 * 2, sizeof *many->mode);
  f = many;
  assert_refused("129 modes for each of 2 lungs are more than 256 weights");
  f = own;
  fixture_destroy(many);
  end();
}
