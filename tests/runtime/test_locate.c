/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test the expected errors of positions, and the location of lungs from observed points. */
#include "tests/helpers/test.h"

#include <supine/locate.h>

#include "runtime/expected.h"
#include "tests/helpers/runtime_fixture.h"

enum { VERTICES = 400, SEEN = 20 };

typedef struct world {
  unsigned char *bytes;
  supine_basis *basis;
  supine_observation seen[SEEN];
  double *space;
  supine_locate_residual residuals[SEEN];
} world;

static int setup(void **state) {
  world *w = fixture_allocate(1, sizeof *w);
  fixture *f = fixture_create_shrinking(VERTICES, 2, 77);
  supine_error error = {0};
  size_t size = 0;
  f->resting = fixture_resting;
  w->bytes = fixture_bytes(f, &size);
  fixture_destroy(f);
  if (supine_basis_open_memory(w->bytes, size, &w->basis, &error) != SUPINE_OK) {
    fail_msg("%s", error.message);
  }
  w->space = fixture_allocate(supine_locate_space(SEEN), sizeof *w->space);
  *state = w;
  return 0;
}

static int teardown(void **state) {
  world *w = *state;
  supine_basis_close(w->basis);
  free(w->bytes);
  free(w->space);
  free(w);
  return 0;
}

static supine_state state_of(const char *text) {
  supine_state state = {.gravity = {0, 1, 0}};
  assert_int_equal(supine_state_parse(text, &state, NULL), SUPINE_OK);
  return state;
}

/* Set xyz [VERTICES, 3] to the positions of all vertices in a state, mm. */
static void deform(const supine_basis *basis, const supine_state *state, float *xyz) {
  supine_pose pose;
  supine_error error = {0};
  if (supine_basis_pose(basis, state, &pose, &error) != SUPINE_OK) {
    fail_msg("%s", error.message);
  }
  supine_deform(basis, &pose, xyz);
}

/* Convert the point x to another frame of reference: if `turned`, rotate x by 0.7 rad (40 degrees)
 * about the axis (1, 2, 2) / 3. Then shift it. */
static void move(bool turned, const double x[3], double moved[3]) {
  static const double shift[3] = {512, -207, 1020};
  const double c = turned ? cos(0.7) : 1;
  const double s = turned ? sin(0.7) : 0;
  const double a[3] = {1 / 3.0, 2 / 3.0, 2 / 3.0};
  const double along = a[0] * x[0] + a[1] * x[1] + a[2] * x[2];
  for (size_t i = 0; i < 3; ++i) {
    const size_t j = (i + 1) % 3;
    const size_t k = (i + 2) % 3;
    moved[i] = c * x[i] + s * (a[j] * x[k] - a[k] * x[j]) + (1 - c) * along * a[i] + shift[i];
  }
}

/* Observe one in twenty vertices, at their exact positions in a state. */
static void observe(world *w, const supine_state *state, bool turned) {
  float xyz[3 * VERTICES];
  deform(w->basis, state, xyz);
  for (size_t j = 0; j < SEEN; ++j) {
    /* With the offset 19, the sample includes a tip of each lung. */
    const size_t at = j * VERTICES / SEEN + (j % 2) * 19;
    const double x[3] = {(double)xyz[3 * at], (double)xyz[3 * at + 1], (double)xyz[3 * at + 2]};
    w->seen[j] = (supine_observation){.vertex = at, .noise = 1};
    move(turned, x, w->seen[j].position);
  }
}

/* Return the RMS distance between the located and the true positions of all vertices, mm. */
static double miss(const world *w, const supine_location *found, const supine_state *state,
                   bool turned) {
  float truth[3 * VERTICES];
  float xyz[3 * VERTICES];
  float sigma[VERTICES];
  double sum = 0;
  deform(w->basis, state, truth);
  assert_int_equal(supine_locate_positions(found, w->basis, xyz, sigma, NULL), SUPINE_OK);
  for (size_t i = 0; i < VERTICES; ++i) {
    const double x[3] = {(double)truth[3 * i], (double)truth[3 * i + 1], (double)truth[3 * i + 2]};
    double moved[3];
    move(turned, x, moved);
    assert_true(sigma[i] > 0 && sigma[i] < 60);
    for (size_t k = 0; k < 3; ++k) {
      sum += pow((double)xyz[3 * i + k] - moved[k], 2);
    }
  }
  return sqrt(sum / VERTICES);
}

static const supine_location *locate(world *w, const supine_state *state, bool rigid) {
  const supine_locate_task task = {
      .inside = w->basis, .count = SEEN, .observed = w->seen, .state = *state, .rigid = rigid};
  const supine_location *found = NULL;
  supine_error error = {0};
  if (supine_locate(&task, w->residuals, w->space, &found, &error) != SUPINE_OK) {
    fail_msg("%s", error.message);
  }
  return found;
}

TEST(test_locate_points_moved_by_law_positions_and_volume_recovered) {
  world *w = *state;
  const supine_state truth = state_of("prone:rest+300");
  const supine_state posture = state_of("prone");
  double held[2];
  supine_pose pose;
  assert_int_equal(supine_basis_pose(w->basis, &truth, &pose, NULL), SUPINE_OK);
  supine_basis_volumes(w->basis, &pose, held);
  for (int rigid = 0; rigid < 2; ++rigid) {
    observe(w, &truth, rigid == 1);
    const supine_location *const found = locate(w, &posture, rigid == 1);
    const supine_location_info *const about = supine_location_get_info(found);
    print_message("positions err by %.2f mm RMS, volume errs by %.0f mL (expected error %.0f mL), "
                  "residuals %.2f mm RMS\n",
                  miss(w, found, &truth, rigid == 1), about->volume - held[0] - held[1],
                  about->volume_error, about->residual_rms);
    assert_true(miss(w, found, &truth, rigid == 1) < 2.5);
    assert_true(fabs(about->volume - held[0] - held[1]) < about->volume_error);
    assert_true(about->volume_error < about->volume_prior_error);
    assert_int_equal(about->outlier_count, 0);
    assert_true(about->rotation[0] > (rigid == 1 ? 0.7 : 0.999));
  }
}

TEST(test_locate_given_volume_kept) {
  world *w = *state;
  const supine_state truth = state_of("prone:rest+300");
  observe(w, &truth, false);
  const supine_location *const found = locate(w, &truth, false);
  const supine_location_info *const about = supine_location_get_info(found);
  assert_int_equal(about->state.volume.kind, SUPINE_VOLUME_REST);
  assert_true(about->volume_error == 0);
  assert_true(miss(w, found, &truth, false) < 0.05);
}

/* Three points, the fewest that determine a rotation, give the exact one. */
TEST(test_locate_rotation_from_three_points_exact) {
  world *w = *state;
  const supine_state truth = state_of("prone:rest+300");
  observe(w, &truth, true);
  w->seen[1] = w->seen[9];
  w->seen[2] = w->seen[18];
  const supine_locate_task task = {
      .inside = w->basis, .count = 3, .observed = w->seen, .state = truth, .rigid = true};
  const supine_location *found = NULL;
  assert_int_equal(supine_locate(&task, w->residuals, w->space, &found, NULL), SUPINE_OK);
  assert_true(miss(w, found, &truth, true) < 0.05);
}

TEST(test_locate_wrong_point_reported_and_ignored) {
  world *w = *state;
  const supine_state truth =
      state_of("left:full-700"); /* a state in which expected errors are about 10 mm */
  const supine_state posture = state_of("left");
  observe(w, &truth, false);
  const supine_location *const before = locate(w, &posture, false);
  float xyz[2][3 * VERTICES];
  float sigma[VERTICES];
  assert_int_equal(supine_locate_positions(before, w->basis, xyz[0], sigma, NULL), SUPINE_OK);
  for (size_t wrong = 0; wrong < SEEN; ++wrong) {
    for (size_t axis = 0; axis < 3; ++axis) {
      w->seen[wrong].position[axis] += 30;
      const supine_location *const found = locate(w, &posture, false);
      w->seen[wrong].position[axis] -= 30;
      assert_int_equal(supine_location_get_info(found)->outlier_count, 1);
      assert_true(w->residuals[wrong].outlier);
      assert_true(w->residuals[wrong].distance > 20);
      assert_int_equal(supine_locate_positions(found, w->basis, xyz[1], sigma, NULL), SUPINE_OK);
      double square = 0;
      for (size_t i = 0; i < (size_t)3 * VERTICES; ++i) {
        square += pow((double)(xyz[1][i] - xyz[0][i]), 2) / VERTICES;
      }
      assert_true(sqrt(square) < 1);
    }
  }
}

TEST(test_locate_any_number_of_points_error_at_most_prior) {
  world *w = *state;
  const supine_state truth = state_of("supine:scan-900");
  float expected[VERTICES];
  float xyz[3 * VERTICES];
  float sigma[VERTICES];
  observe(w, &truth, false);
  assert_int_equal(supine_expected_error(w->basis, &truth, NULL, expected, NULL), SUPINE_OK);
  for (size_t count = 3; count <= SEEN; ++count) {
    const supine_locate_task task = {
        .inside = w->basis, .count = count, .observed = w->seen, .state = truth};
    const supine_location *found = NULL;
    assert_int_equal(supine_locate(&task, w->residuals, w->space, &found, NULL), SUPINE_OK);
    assert_int_equal(supine_locate_positions(found, w->basis, xyz, sigma, NULL), SUPINE_OK);
    for (size_t i = 0; i < VERTICES; ++i) {
      /* Observing points must not increase the expected error. Only an error below 3 mm may rise,
       * up to 3 mm: supine_locate treats displacements below 2 mm as 2 mm, for which the expected
       * error is sqrt(4.5 mm * 2 mm) = 3 mm. */
      assert_true(sigma[i] <= fmaxf(3.01F, 1.0001F * expected[i]));
    }
  }
}

TEST(test_locate_one_point_no_residual) {
  world *w = *state;
  const supine_state truth = state_of("supine:scan-900");
  observe(w, &truth, false);
  for (size_t count = 1; count < 3; ++count) {
    const supine_locate_task task = {
        .inside = w->basis, .count = count, .observed = w->seen, .state = truth};
    const supine_location *found = NULL;
    assert_int_equal(supine_locate(&task, w->residuals, w->space, &found, NULL), SUPINE_OK);
    assert_int_equal(w->residuals[0].sigma > 0, count > 1);
    assert_true(miss(w, found, &truth, false) < 0.05);
  }
}

TEST(test_locate_bad_task_refused) {
  world *w = *state;
  const supine_state truth = state_of("supine:rest");
  observe(w, &truth, false);
  const supine_observation good = w->seen[0];
  const supine_observation bad[] = {
      {.vertex = VERTICES, .noise = 1},
      {.position = {0, (double)NAN, 0}, .noise = 1},
      {.position = {0, 0, (double)INFINITY}, .noise = 1},
      {.noise = 0},
      {.noise = (double)NAN},
      {.noise = 1, .on_line = true},
      {.noise = 1, .on_line = true, .from = {1, (double)NAN, 0}},
      {.noise = 1, .on_line = true, .from = {0, 0, (double)-INFINITY}}};
  const supine_location *found = NULL;
  supine_error error;
  supine_locate_task task = {
      .inside = w->basis, .count = SEEN, .observed = w->seen, .state = truth};
  for (size_t i = 0; i < sizeof bad / sizeof *bad; ++i) {
    w->seen[0] = bad[i];
    assert_int_equal(supine_locate(&task, w->residuals, w->space, &found, &error),
                     SUPINE_ERROR_ARGUMENT);
    assert_null(found);
  }
  w->seen[0] = good;
  for (size_t i = 0; i < 2; ++i) {
    task.depth = i == 0 ? -1 : (double)NAN;
    assert_int_equal(supine_locate(&task, w->residuals, w->space, &found, &error),
                     SUPINE_ERROR_ARGUMENT);
  }
  task.depth = 0;
  const size_t counts[] = {0, SUPINE_LOCATE_POINTS_MAX + 1};
  for (size_t i = 0; i < 2; ++i) {
    task.count = counts[i];
    assert_int_equal(supine_locate(&task, w->residuals, w->space, &found, &error),
                     SUPINE_ERROR_ARGUMENT);
  }
  task.rigid = true;
  task.count = 2;
  assert_int_equal(supine_locate(&task, w->residuals, w->space, &found, &error),
                   SUPINE_ERROR_ARGUMENT);
}

/* The formula of supine/locate.h, written again: displacement, assumed volume at rest, heart and
 * sliding. The terms that supine_expected_parts returns add up to the error. */
TEST(test_expected_error_any_state_equals_formula) {
  world *w = *state;
  const supine_basis_info *info = supine_basis_get_info(w->basis);
  const double full = info->reference_volume[0] + info->reference_volume[1];
  const char *const states[] = {"prone:scan-900", "supine:scan-20", "left:rest+100"};
  double low[3] = {INFINITY, INFINITY, INFINITY};
  double high[3] = {-INFINITY, -INFINITY, -INFINITY};
  for (size_t i = 0; i < (size_t)3 * VERTICES; ++i) {
    low[i % 3] = fmin(low[i % 3], (double)info->vertices[i]);
    high[i % 3] = fmax(high[i % 3], (double)info->vertices[i]);
  }
  for (size_t s = 0; s < 3; ++s) {
    const supine_state asked = state_of(states[s]);
    const supine_state scan = supine_basis_scan(w->basis);
    supine_state fuller = asked;
    fuller.volume.ml += 0.08 * full;
    float x[3][3 * VERTICES];
    float sigma[VERTICES];
    supine_expected_part parts[SUPINE_EXPECTED_TERMS];
    double squares = 0;
    double sum[2] = {0, 0};
    deform(w->basis, &asked, x[0]);
    deform(w->basis, &scan, x[1]);
    deform(w->basis, &fuller, x[2]);
    for (size_t i = 0; i < (size_t)3 * VERTICES; ++i) {
      squares += pow((double)(x[0][i] - x[1][i]), 2) / VERTICES;
    }
    const double c = fmin(4.5, 0.25 * sqrt(squares));
    const double turn[2] = {fabs(asked.gravity[0]), fabs(asked.gravity[1] - 1)};
    assert_int_equal(supine_expected_error(w->basis, &asked, NULL, sigma, NULL), SUPINE_OK);
    for (size_t i = 0; i < VERTICES; ++i) {
      const float *p = info->vertices + 3 * i;
      const double middle = 0.5 * (low[0] + high[0]);
      const double side = fabs((double)p[0] - middle) / (high[0] - middle);
      const double back = (high[1] - (double)p[1]) / (high[1] - low[1]);
      const double apex = (high[2] - (double)p[2]) / (high[2] - low[2]);
      const double heart = 12 * hypot(turn[0], turn[1]) * fmax(0, 1 - side / 0.7) * 4 * back *
                           (1 - back) * fmax(0, 1 - fabs(apex - 0.65) / 0.35);
      double u = 0;
      double slope = 0;
      for (size_t j = 3 * i; j < 3 * i + 3; ++j) {
        u += pow((double)(x[0][j] - x[1][j]), 2);
        slope += asked.volume.kind == SUPINE_VOLUME_REST ? pow((double)(x[2][j] - x[0][j]), 2) : 0;
      }
      const double expected = sqrt(c * sqrt(u) + slope + heart * heart + pow(3 * turn[0], 2));
      assert_true(fabs((double)sigma[i] - expected) < 1e-3 + 0.03 * expected);
      sum[0] += pow((double)sigma[i], 2) / VERTICES;
    }
    assert_int_equal(supine_expected_parts(w->basis, &asked, NULL, parts, NULL), SUPINE_OK);
    for (size_t k = 0; k < SUPINE_EXPECTED_TERMS; ++k) {
      assert_true(strlen(parts[k].name) > 0 && strlen(parts[k].source) > 0);
      sum[1] += parts[k].rms * parts[k].rms;
    }
    assert_true(fabs(sum[1] - sum[0]) < 1e-5 * sum[0]);
  }
  const supine_state scan = supine_basis_scan(w->basis);
  float sigma[VERTICES];
  assert_int_equal(supine_expected_error(w->basis, &scan, NULL, sigma, NULL), SUPINE_OK);
  for (size_t i = 0; i < VERTICES; ++i) {
    assert_true(sigma[i] == 0);
  }
}

/* Evaluate the squared errors of vertex `of`, relative to vertex `to` as if it were the only
 * anchor. */
static void relate(supine_expected_model *model, size_t of, size_t to,
                   double square[SUPINE_EXPECTED_TERMS]) {
  static supine_expected_block block;
  const float *p = supine_basis_vertices(model->basis) + 3 * to;
  supine_expected_anchor *anchor = &model->anchor[0];
  model->anchor_count = 0;
  supine_expected_evaluate(model, to, to + 1, &block);
  *anchor = (supine_expected_anchor){.beside_heart = 0};
  for (size_t i = 0; i < 3; ++i) {
    anchor->position[i] = (double)p[i];
    for (size_t pair = 0; pair < EXPECTED_POSES / 2; ++pair) {
      anchor->u[pair][i] = (double)block.x[2 * pair][i] - (double)block.x[2 * pair + 1][i];
    }
  }
  model->anchor_count = 1;
  supine_expected_evaluate(model, of, of + 1, &block);
  memcpy(square, block.square[0], SUPINE_EXPECTED_TERMS * sizeof *square);
}

/* The error of a difference is 0 between a point and itself, the same both ways, smaller to a
 * neighbour than to a distant point, and never more than the two errors of one sign added. */
TEST(test_expected_relative_error_is_that_of_the_difference) {
  world *w = *state;
  const supine_state asked = state_of("supine:rest");
  const supine_state scan = supine_basis_scan(w->basis);
  const float *p = supine_basis_vertices(w->basis);
  const size_t end = supine_basis_get_info(w->basis)->lung_begin[1];
  supine_expected_model model;
  double square[3][SUPINE_EXPECTED_TERMS];
  assert_int_equal(supine_expected_prepare(w->basis, &asked, &scan, 0, 0, &model, NULL), SUPINE_OK);
  size_t near = 1;
  size_t far = 1;
  for (size_t i = 1; i < end; ++i) {
    const double at[3] = {(double)p[3 * i], (double)p[3 * i + 1], (double)p[3 * i + 2]};
    double apart[3] = {0, 0, 0};
    const size_t others[2] = {near, far};
    for (size_t k = 0; k < 3; ++k) {
      apart[0] += pow(at[k] - (double)p[k], 2);
      apart[1] += pow((double)p[3 * others[0] + k] - (double)p[k], 2);
      apart[2] += pow((double)p[3 * others[1] + k] - (double)p[k], 2);
    }
    near = apart[0] < apart[1] ? i : near;
    far = apart[0] > apart[2] ? i : far;
  }
  relate(&model, 0, 0, square[0]);
  assert_true(square[0][SUPINE_EXPECTED_DISPLACEMENT] < 1e-4);
  assert_true(square[0][SUPINE_EXPECTED_VOLUME] < 1e-4);
  relate(&model, 0, far, square[0]);
  relate(&model, far, 0, square[1]);
  relate(&model, 0, near, square[2]);
  for (size_t k = 0; k < SUPINE_EXPECTED_HEART; ++k) {
    assert_true(fabs(square[0][k] - square[1][k]) <= 1e-4 * (1 + square[0][k]));
  }
  assert_true(square[2][SUPINE_EXPECTED_DISPLACEMENT] <
              0.7 * square[0][SUPINE_EXPECTED_DISPLACEMENT]);
}

/* Replace each observed point by lines from `views` sources, 700 mm away and 30 degrees apart. */
static void view(const world *w, size_t views, supine_observation *lines) {
  for (size_t j = 0; j < views * SEEN; ++j) {
    const double angle = (double)(j % views) * 0.52;
    const double source[3] = {512 + 700 * sin(angle), -207 - 700 * cos(angle), 1020};
    lines[j] = w->seen[j / views];
    lines[j].on_line = true;
    for (size_t i = 0; i < 3; ++i) { /* a detector behind the lungs */
      lines[j].position[i] += 0.5 * (lines[j].position[i] - source[i]);
      lines[j].from[i] = source[i];
    }
  }
}

TEST(test_locate_lines_of_two_views_equal_points_and_one_view_leaves_the_depth) {
  world *w = *state;
  const supine_state truth = state_of("prone:rest+300");
  supine_observation lines[2 * SEEN];
  supine_locate_residual residuals[2 * SEEN];
  double *space = fixture_allocate(supine_locate_space(2 * SEEN), sizeof *space);
  float xyz[3 * VERTICES];
  float sigma[3][VERTICES];
  observe(w, &truth, false);
  const supine_location *found = locate(w, &truth, false);
  assert_int_equal(supine_locate_positions(found, w->basis, xyz, sigma[0], NULL), SUPINE_OK);
  assert_true(supine_location_get_info(found)->depth_error == 0);
  supine_locate_task task = {.inside = w->basis, .observed = lines, .state = truth};
  for (size_t views = 1; views < 3; ++views) {
    view(w, views, lines);
    task.count = views * SEEN;
    task.depth = views == 1 ? 400 : 0; /* the frame is translated by 207 mm along one view */
    assert_int_equal(supine_locate(&task, residuals, space, &found, NULL), SUPINE_OK);
    const double depth = supine_location_get_info(found)->depth_error;
    const double missed = miss(w, found, &truth, false);
    print_message("%zu views: positions err by %.2f mm, depth is known to %.1f mm\n", views, missed,
                  depth);
    if (views == 1) {
      assert_true(depth > 5 && depth < 400 && missed < depth);
    } else {
      assert_true(depth == 0 && missed < 0.5);
    }
    assert_int_equal(supine_locate_positions(found, w->basis, xyz, sigma[views], NULL), SUPINE_OK);
    assert_true(sigma[1][0] > sigma[0][0]);
  }
  assert_true(sigma[2][0] < sigma[1][0]);
  task.rigid = true; /* two vertices, however many views */
  task.count = 4;
  assert_int_equal(supine_locate(&task, residuals, space, &found, NULL), SUPINE_ERROR_ARGUMENT);
  free(space);
}

/* A random wrong half of the points must raise the stated errors; what no patient has is
 * refused. */
TEST(test_locate_residuals_beyond_stated_errors_raise_them_or_are_refused) {
  world *w = *state;
  const supine_state truth = state_of("supine:full-700");
  float xyz[3 * VERTICES];
  float sigma[2][VERTICES];
  const supine_location *found = NULL;
  supine_error error;
  for (int off = 0; off < 2; ++off) {
    observe(w, &truth, false);
    for (size_t j = 0; j < SEEN; ++j) {
      w->seen[j].position[j % 3] += off * (j % 2 == 0 ? 20 : -20);
    }
    found = locate(w, &truth, false);
    assert_int_equal(supine_locate_positions(found, w->basis, xyz, sigma[off], NULL), SUPINE_OK);
  }
  assert_true(sigma[1][0] > 1.5F * sigma[0][0]);
  const supine_locate_task task = {
      .inside = w->basis, .count = SEEN, .observed = w->seen, .state = state_of("supine")};
  const struct {
    double factor; /* on the positions that were observed */
    const char *said;
  } bad[] = {{0, "at one place"}, {-1, "do not fit"}, {0.2, "under 10 %"}};
  for (size_t i = 0; i < sizeof bad / sizeof *bad; ++i) {
    observe(w, &truth, false);
    for (size_t j = 0; j < SEEN; ++j) {
      w->seen[j].position[0] *= bad[i].factor;
      w->seen[j].position[1] *= fabs(bad[i].factor);
      w->seen[j].position[2] *= fabs(bad[i].factor);
    }
    assert_int_equal(supine_locate(&task, w->residuals, w->space, &found, &error),
                     SUPINE_ERROR_NUMERICAL);
    assert_says(error.message, bad[i].said);
  }
}

/* A slope of 1.25 along x, in a turned frame, too. */
TEST(test_locate_points_of_wider_lungs_stretch_found_and_told) {
  world *w = *state;
  const supine_state truth = state_of("supine:full-700");
  for (int turned = 0; turned < 2; ++turned) {
    float xyz[3 * VERTICES];
    supine_findings findings = {.count = 0};
    observe(w, &truth, false);
    deform(w->basis, &truth, xyz);
    const supine_location_info *about = supine_location_get_info(locate(w, &truth, false));
    assert_true(fabs(about->stretch[0] - 1) < 1e-5 && about->stretch_error[0] < 1e-5);
    for (size_t j = 0; j < SEEN; ++j) {
      const size_t at = w->seen[j].vertex;
      const double x[3] = {1.25 * (double)xyz[3 * at], (double)xyz[3 * at + 1],
                           (double)xyz[3 * at + 2]};
      move(turned == 1, x, w->seen[j].position);
    }
    about = supine_location_get_info(locate(w, &truth, turned == 1));
    const double most = turned == 1 ? 0.1 : 1e-5; /* the rotation that fits best is another */
    assert_true(fabs(about->stretch[0] - 1.25) < most);
    assert_true(fabs(about->stretch[1] - 1) < most && fabs(about->stretch[2] - 1) < most);
    supine_location_check(about, &findings);
    assert_int_equal(findings.count, 1);
    assert_says(findings.list[0].text, "the width of what the points show is 1.2");
  }
}

TEST_GROUP(setup, teardown)
