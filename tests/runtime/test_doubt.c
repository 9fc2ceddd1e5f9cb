/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test the expected error as a random field: covariance, registration at fiducials, samples. */
#include "tests/helpers/test.h"

#include <supine/doubt.h>

#include "runtime/kriging.h"
#include "tests/helpers/runtime_fixture.h"

enum { VERTICES = 40, STATES = 4, PER_STATE = 6, POINTS = STATES * PER_STATE, SIZE = 3 * POINTS };

static const char *const names[STATES] = {"supine:rest", "prone:rest", "left:rest+300", "2000mL"};

typedef struct world {
  fixture *fixture;
  unsigned char *bytes;
  supine_basis *basis;
  supine_state states[STATES];
  double *space;
  const supine_doubt *doubt;
  supine_doubt_point points[POINTS];
  double mean[3 * POINTS], covariance[SIZE * SIZE];
} world;

static const supine_doubt *prepare(world *w, bool another_day, double *space) {
  const supine_doubt_task task = {
      .basis = w->basis, .state_count = STATES, .states = w->states, .another_day = another_day};
  const supine_doubt *doubt = NULL;
  supine_error error = {0};
  if (supine_doubt_prepare(&task, space, &doubt, &error) != SUPINE_OK) {
    fail_msg("%s", error.message);
  }
  return doubt;
}

static int setup(void **state) {
  world *w = fixture_allocate(1, sizeof *w);
  fixture *f = fixture_create_shrinking(VERTICES, 2, 77);
  size_t size = 0;
  f->resting = fixture_resting;
  w->bytes = fixture_bytes(f, &size);
  w->fixture = f;
  assert_int_equal(supine_basis_open_memory(w->bytes, size, &w->basis, NULL), SUPINE_OK);
  for (size_t s = 0; s < STATES; ++s) {
    w->states[s].gravity[1] = 1;
    assert_int_equal(supine_state_parse(names[s], &w->states[s], NULL), SUPINE_OK);
  }
  for (size_t i = 0; i < POINTS; ++i) {
    w->points[i] = (supine_doubt_point){i % PER_STATE * 6 + 4, i / PER_STATE};
  }
  w->space = fixture_allocate(supine_doubt_space(w->basis, STATES), sizeof *w->space);
  w->doubt = prepare(w, false, w->space);
  assert_int_equal(
      supine_doubt_covariance(w->doubt, POINTS, w->points, w->mean, w->covariance, NULL),
      SUPINE_OK);
  *state = w;
  return 0;
}

static int teardown(void **state) {
  world *w = *state;
  supine_basis_close(w->basis);
  fixture_destroy(w->fixture);
  free(w->bytes);
  free(w->space);
  free(w);
  return 0;
}

/* Where no volume is assumed and the posture stays, all of the error is a kernel. */
TEST(test_covariance_known_volume_equals_kernel_of_expected_error) {
  const world *w = *state;
  const size_t first = SIZE / STATES * (STATES - 1); /* of the last state, supine and 2000 mL */
  const float *vertices = supine_basis_vertices(w->basis);
  float sigma[VERTICES];
  assert_int_equal(supine_expected_error(w->basis, &w->states[STATES - 1], NULL, sigma, NULL),
                   SUPINE_OK);
  for (size_t i = 0; i < PER_STATE; ++i) {
    for (size_t j = 0; j < PER_STATE; ++j) {
      const size_t at[2] = {w->points[i].vertex, w->points[j].vertex};
      double square = 0;
      for (size_t k = 0; k < 3; ++k) {
        square += pow((double)vertices[3 * at[0] + k] - (double)vertices[3 * at[1] + k], 2);
      }
      const double a = sqrt(3 * square) / 90;
      const double lungs = (at[0] < VERTICES / 2) == (at[1] < VERTICES / 2) ? 1 : 1 / 3.0;
      const double expected =
          4.0 / 9 * (double)sigma[at[0]] * (double)sigma[at[1]] * lungs * (1 + a) * exp(-a);
      const double *block = w->covariance + (first + 3 * i) * SIZE + first + 3 * j;
      assert_close(block[0], expected, 1e-5 * expected);
      assert_close(block[2 * SIZE + 2], expected, 1e-5 * expected);
      assert_true(block[1] == 0 && block[SIZE] == 0);
    }
  }
}

TEST(test_expected_error_from_impossible_state_refused) {
  const world *w = *state;
  const supine_doubt *doubt = NULL;
  float sigma[VERTICES];
  double space[8192];
  supine_expected_part parts[SUPINE_EXPECTED_TERMS];
  supine_state from;
  supine_error error = {0};
  assert_int_equal(supine_state_parse("supine:90L", &from, &error), SUPINE_OK);
  const supine_doubt_task task = {w->basis, 1, w->states, &from, false, NULL};
  assert_true(supine_doubt_space(w->basis, 1) <= sizeof space / sizeof *space);
  assert_int_equal(supine_expected_error(w->basis, w->states, &from, sigma, &error),
                   SUPINE_ERROR_NUMERICAL);
  assert_says(error.message, "supine at 90000 mL");
  assert_int_equal(supine_expected_parts(w->basis, w->states, &from, parts, &error),
                   SUPINE_ERROR_NUMERICAL);
  assert_int_equal(supine_doubt_prepare(&task, space, &doubt, &error), SUPINE_ERROR_NUMERICAL);
  assert_null(doubt);
}

/* After a fit of landmarks, the term of the displacement is the same everywhere but for the share
 * that these leave, with the mean square that the displacement's RMS gives. */
TEST(test_expected_error_after_landmarks_follows_their_shares) {
  world *w = *state;
  float share[VERTICES];
  float plain[VERTICES];
  float sigma[VERTICES];
  supine_basis *shared = NULL;
  supine_error error = {0};
  size_t size = 0;
  const supine_state *given = &w->states[STATES - 1]; /* the displacement is the only term */
  for (size_t i = 0; i < VERTICES; ++i) {
    share[i] = 0.5F + (float)(i * 7 % VERTICES) / VERTICES;
  }
  w->fixture->error_share = share;
  unsigned char *bytes = fixture_bytes(w->fixture, &size);
  assert_int_equal(supine_basis_open_memory(bytes, size, &shared, &error), SUPINE_OK);
  assert_int_equal(supine_expected_error(shared, given, NULL, sigma, NULL), SUPINE_OK);
  assert_int_equal(supine_expected_error(w->basis, given, NULL, plain, NULL), SUPINE_OK);
  double fourth = 0; /* sigma^2 is in proportion to the displacement without shares */
  double second = 0;
  for (size_t i = 0; i < VERTICES; ++i) {
    fourth += pow((double)plain[i], 4) / VERTICES;
    second += pow((double)sigma[i], 2) / (double)share[i] / VERTICES;
  }
  assert_close(second, sqrt(fourth), 1e-3 * second);
  for (size_t i = 0; i < VERTICES; ++i) {
    assert_close(pow((double)sigma[i], 2), second * (double)share[i], 1e-4 * second);
  }
  supine_basis_close(shared);
  free(bytes);
  share[3] = -1;
  bytes = fixture_bytes(w->fixture, &size);
  w->fixture->error_share = NULL;
  assert_int_equal(supine_basis_open_memory(bytes, size, &shared, &error), SUPINE_ERROR_FORMAT);
  assert_says(error.message, "tensor 'error_share' has -1 at vertex 3");
  free(bytes);
}

/* The covariance of points in four states is symmetric and positive semidefinite, and its diagonal
 * lies between the square of the expected error and 4/3 of it. */
TEST(test_covariance_several_states_positive) {
  world *w = *state;
  static double factor[SIZE * SIZE];
  memcpy(factor, w->covariance, sizeof factor);
  for (size_t i = 0; i < SIZE; ++i) {
    for (size_t j = 0; j < SIZE; ++j) {
      assert_true(factor[i * SIZE + j] == factor[j * SIZE + i]);
    }
  }
  for (size_t i = 0; i < SIZE; ++i) {
    factor[i * SIZE + i] += 1e-9 * w->covariance[0];
  }
  assert_true(supine_kriging_factor(SIZE, factor));
  for (size_t i = 0; i < POINTS; ++i) {
    float sigma[VERTICES];
    double trace = 0;
    const supine_doubt_point *p = &w->points[i];
    assert_int_equal(supine_expected_error(w->basis, &w->states[p->state], NULL, sigma, NULL),
                     SUPINE_OK);
    const double square = (double)sigma[p->vertex] * (double)sigma[p->vertex];
    for (size_t k = 0; k < 3; ++k) {
      trace += w->covariance[(3 * i + k) * (SIZE + 1)];
    }
    assert_true(trace > square * (1 - 1e-5) && trace < 4.0 / 3 * square * (1 + 1e-5));
  }
}

/* Another day adds the same kernel with 6.2 mm. */
TEST(test_covariance_another_day_adds_its_kernel) {
  world *w = *state;
  static double other[SIZE * SIZE];
  double *space = fixture_allocate(supine_doubt_space(w->basis, STATES), sizeof *space);
  const supine_doubt *doubt = prepare(w, true, space);
  assert_int_equal(supine_doubt_covariance(doubt, POINTS, w->points, NULL, other, NULL), SUPINE_OK);
  assert_close(other[0] - w->covariance[0], 4.0 / 9 * 6.2 * 6.2, 1e-9);
  /* the same vertex in two states is on the same day */
  const size_t next = SIZE / STATES;
  assert_close(other[next] - w->covariance[next], 4.0 / 9 * 6.2 * 6.2, 1e-9);
  free(space);
}

/* Solve a x = b [6] in place by elimination. */
static void solve(double a[6][6], double b[6]) {
  for (size_t k = 0; k < 6; ++k) {
    for (size_t r = 0; r < 6; ++r) {
      const double factor = r == k ? 0 : a[r][k] / a[k][k];
      for (size_t c = 0; c < 6; ++c) {
        a[r][c] -= factor * a[k][c];
      }
      b[r] -= factor * b[k];
    }
  }
  for (size_t k = 0; k < 6; ++k) {
    b[k] /= a[k][k];
  }
}

/* Add translation + rotation x (p - c) of six parameters. */
static void add_motion(const double y[6], const double p[3], const double c[3], double factor,
                       double moved[3]) {
  const double v[3] = {p[0] - c[0], p[1] - c[1], p[2] - c[2]};
  for (size_t k = 0; k < 3; ++k) {
    const size_t i = (k + 1) % 3;
    const size_t j = (k + 2) % 3;
    moved[k] += factor * (y[k] + y[3 + i] * v[j] - y[3 + j] * v[i]);
  }
}

/* After a registration, the stated errors are those of random lungs that are registered by least
 * squares, and smaller than before near the fiducials. */
TEST(test_frame_errors_equal_those_of_registered_samples) {
  enum { FIDUCIALS = 5, SAMPLES = 500 };
  world *w = *state;
  static const size_t at[FIDUCIALS] = {3, 11, 18, 25, 37};
  double space[2000];
  const supine_doubt_frame *frame = NULL;
  float sigma[VERTICES];
  float xyz[3 * VERTICES];
  double predicted[3 * VERTICES];
  double seen[VERTICES] = {0};
  assert_true(supine_doubt_frame_space(w->basis, FIDUCIALS) <= 2000);
  assert_int_equal(supine_doubt_frame_prepare(w->doubt, FIDUCIALS, at, space, &frame, NULL),
                   SUPINE_OK);
  assert_int_equal(supine_doubt_frame_errors(frame, 0, VERTICES, sigma), SUPINE_OK);
  supine_pose pose;
  assert_int_equal(supine_basis_pose(w->basis, &w->states[0], &pose, NULL), SUPINE_OK);
  supine_deform(w->basis, &pose, xyz);
  for (size_t i = 0; i < 3 * VERTICES; ++i) {
    predicted[i] = (double)xyz[i];
  }
  double place[3 * VERTICES];
  double centre[3] = {0};
  for (size_t i = 0; i < 3 * VERTICES; ++i) {
    place[i] = (double)supine_basis_vertices(w->basis)[i];
  }
  for (size_t i = 0; i < 3 * FIDUCIALS; ++i) {
    centre[i % 3] += place[3 * at[i / 3] + i % 3] / FIDUCIALS;
  }
  for (size_t s = 0; s < SAMPLES; ++s) {
    double normal[6][6] = {{0}};
    double y[6] = {0};
    assert_int_equal(supine_doubt_sample(w->doubt, 0, 11, s, xyz, NULL), SUPINE_OK);
    for (size_t f = 0; f < FIDUCIALS; ++f) {
      double column[6][3];
      for (size_t e = 0; e < 6; ++e) {
        const double unit[6] = {e == 0, e == 1, e == 2, e == 3, e == 4, e == 5};
        memset(column[e], 0, sizeof column[e]);
        add_motion(unit, place + 3 * at[f], centre, 1, column[e]);
      }
      for (size_t e = 0; e < 6; ++e) {
        for (size_t k = 0; k < 3; ++k) {
          y[e] += column[e][k] * ((double)xyz[3 * at[f] + k] - predicted[3 * at[f] + k]);
          for (size_t g = 0; g < 6; ++g) {
            normal[e][g] += column[e][k] * column[g][k];
          }
        }
      }
    }
    solve(normal, y);
    for (size_t i = 0; i < VERTICES; ++i) {
      double error[3];
      for (size_t k = 0; k < 3; ++k) {
        error[k] = (double)xyz[3 * i + k] - predicted[3 * i + k];
      }
      add_motion(y, place + 3 * i, centre, -1, error);
      seen[i] += (error[0] * error[0] + error[1] * error[1] + error[2] * error[2]) / SAMPLES;
    }
  }
  for (size_t i = 0; i < VERTICES; ++i) {
    assert_true(sqrt(seen[i]) > 0.85 * (double)sigma[i] && sqrt(seen[i]) < 1.15 * (double)sigma[i]);
  }
  double rotation[9];
  double translation[3];
  supine_doubt_frame_motion(frame, rotation, translation);
  assert_true(rotation[0] > 0.9 && rotation[4] > 0.9 && rotation[8] > 0.9);
}

/* Assert that of many samples, each variance is within 15 % of the formula, and the covariances
 * within 5 % RMS of the variance.
 * @param count  of points, at most POINTS, ordered by their states */
static void check_samples(const supine_doubt *doubt, size_t samples, size_t count,
                          const supine_doubt_point *points, const char *what) {
  static double covariance[SIZE * SIZE];
  static double found[SIZE * SIZE];
  const size_t size = 3 * count;
  double mean[SIZE];
  double deviation[SIZE];
  float xyz[3 * VERTICES];
  assert_int_equal(supine_doubt_covariance(doubt, count, points, mean, covariance, NULL),
                   SUPINE_OK);
  memset(found, 0, sizeof found);
  for (size_t s = 0; s < samples; ++s) {
    for (size_t i = 0; i < count; ++i) {
      if (i == 0 || points[i].state != points[i - 1].state) {
        assert_int_equal(supine_doubt_sample(doubt, points[i].state, 5, s, xyz, NULL), SUPINE_OK);
      }
      for (size_t k = 0; k < 3; ++k) {
        deviation[3 * i + k] = (double)xyz[3 * points[i].vertex + k] - mean[3 * i + k];
      }
    }
    for (size_t e = 0; e < size * size; ++e) {
      found[e] += deviation[e / size] * deviation[e % size] / (double)samples;
    }
  }
  double sum = 0;
  for (size_t e = 0; e < size * size; ++e) {
    const size_t i = e / size;
    const size_t j = e % size;
    const double scale = sqrt(covariance[i * size + i] * covariance[j * size + j]);
    sum += pow((found[e] - covariance[e]) / scale, 2) / (double)(size * size);
    assert_true(i != j || fabs(found[e] / scale - 1) < 0.15);
  }
  print_message("%s: covariances of samples differ by %.3f of the variance (RMS)\n", what,
                sqrt(sum));
  assert_true(sqrt(sum) < 0.05);
}

/* Seed and index decide a sample. */
TEST(test_sample_thousand_have_the_covariance) {
  const world *w = *state;
  float xyz[2][3 * VERTICES];
  check_samples(w->doubt, 1000, POINTS, w->points, "four states");
  for (size_t i = 0; i < 2; ++i) {
    assert_int_equal(supine_doubt_sample(w->doubt, 3, 5, 17, xyz[i], NULL), SUPINE_OK);
  }
  assert_memory_equal(xyz[0], xyz[1], sizeof xyz[0]);
  assert_int_equal(supine_doubt_sample(w->doubt, 3, 6, 17, xyz[1], NULL), SUPINE_OK);
  assert_memory_not_equal(xyz[0], xyz[1], sizeof xyz[0]);
}

/* Compute the volume of a lung, mm^3, and its change with every coordinate, mm^2. */
static double find_gradient(const world *w, size_t lung, const float *xyz,
                            double gradient[3 * VERTICES]) {
  double moved[3 * VERTICES];
  for (size_t i = 0; i < 3 * VERTICES; ++i) {
    moved[i] = (double)xyz[i];
  }
  const double volume = fixture_volume(w->fixture, lung, moved);
  for (size_t i = 0; i < 3 * VERTICES; ++i) { /* a volume is linear in each coordinate */
    moved[i] += 1;
    gradient[i] = 1e3 * (fixture_volume(w->fixture, lung, moved) - volume);
    moved[i] -= 1;
  }
  return 1e3 * volume;
}

/* Compute the variances of all coordinates if both volumes are known: the diagonal of C - C g (g' C
 * g)^-1 g' C. */
static void condition(const world *w, size_t state, const float *predicted,
                      double variance[3 * VERTICES]) {
  enum { N = 3 * VERTICES };
  static double covariance[N * N];
  double gradient[2][N];
  double along[2][N] = {{0}};
  double product[2][2] = {{0}};
  supine_doubt_point points[VERTICES];
  for (size_t i = 0; i < VERTICES; ++i) {
    points[i] = (supine_doubt_point){i, state};
  }
  assert_int_equal(supine_doubt_covariance(w->doubt, VERTICES, points, NULL, covariance, NULL),
                   SUPINE_OK);
  for (size_t a = 0; a < 2; ++a) {
    (void)find_gradient(w, a, predicted, gradient[a]);
    for (size_t e = 0; e < (size_t)N * N; ++e) {
      along[a][e / N] += covariance[e] * gradient[a][e % N];
    }
  }
  for (size_t e = 0; e < 4 * (size_t)N; ++e) {
    product[e % 4 / 2][e % 2] += gradient[e % 4 / 2][e / 4] * along[e % 2][e / 4];
  }
  const double whole = product[0][0] * product[1][1] - product[0][1] * product[1][0];
  for (size_t i = 0; i < N; ++i) {
    const double a = along[0][i];
    const double b = along[1][i];
    variance[i] =
        covariance[i * (N + 1)] -
        (a * a * product[1][1] - 2 * a * b * product[0][1] + b * b * product[0][0]) / whole;
  }
}

/* Return whether a triangle of the fixture has another side outside than before. */
static bool is_turned(const world *w, size_t triangle, const float *before, const float *now) {
  double product = 0;
  double area[2][3];
  for (size_t which = 0; which < 2; ++which) {
    const float *xyz = which == 0 ? before : now;
    const uint32_t *corner = w->fixture->triangle + 3 * triangle;
    double side[2][3];
    for (size_t e = 0; e < 6; ++e) {
      side[e / 3][e % 3] =
          (double)xyz[3 * corner[1 + e / 3] + e % 3] - (double)xyz[3 * corner[0] + e % 3];
    }
    for (size_t k = 0; k < 3; ++k) {
      area[which][k] =
          side[0][(k + 1) % 3] * side[1][(k + 2) % 3] - side[0][(k + 2) % 3] * side[1][(k + 1) % 3];
    }
  }
  for (size_t k = 0; k < 3; ++k) {
    product += area[0][k] * area[1][k];
  }
  return !(product > 0);
}

/* Assert that mended samples of a state hold the predicted volumes, turn no triangle over, and have
 * the errors that remain if the volumes are known: each point's within 10 %. Add to `turned` the
 * triangles that were turned over before. */
static void check_mended(const world *w, size_t s, size_t *turned) {
  enum { SAMPLES = 1000 };
  double *space = fixture_allocate(supine_doubt_mend_space(w->basis), sizeof *space);
  double scratch[3 * VERTICES];
  double square[VERTICES] = {0};
  double variance[3 * VERTICES];
  double volume[2];
  float predicted[3 * VERTICES];
  float xyz[3 * VERTICES];
  const supine_doubt_mend *mend = NULL;
  supine_pose pose;
  assert_int_equal(supine_basis_pose(w->basis, &w->states[s], &pose, NULL), SUPINE_OK);
  supine_deform(w->basis, &pose, predicted);
  condition(w, s, predicted, variance);
  assert_int_equal(supine_doubt_mend_prepare(w->doubt, s, space, &mend, NULL), SUPINE_OK);
  for (size_t lung = 0; lung < 2; ++lung) {
    volume[lung] = find_gradient(w, lung, predicted, scratch);
  }
  for (size_t i = 0; i < SAMPLES; ++i) {
    assert_int_equal(supine_doubt_sample(w->doubt, s, 9, i, xyz, NULL), SUPINE_OK);
    for (size_t t = 0; t < w->fixture->triangles; ++t) {
      *turned += is_turned(w, t, predicted, xyz);
    }
    assert_int_equal(supine_doubt_mend_sample(mend, xyz, NULL), SUPINE_OK);
    for (size_t t = 0; t < w->fixture->triangles; ++t) {
      assert_false(is_turned(w, t, predicted, xyz));
    }
    for (size_t lung = 0; lung < 2; ++lung) {
      assert_close(find_gradient(w, lung, xyz, scratch), volume[lung], 20);
    }
    for (size_t e = 0; e < 3 * VERTICES; ++e) {
      square[e / 3] += pow((double)xyz[e] - (double)predicted[e], 2) / SAMPLES;
    }
  }
  for (size_t i = 0; i < VERTICES; ++i) {
    const double expected = variance[3 * i] + variance[3 * i + 1] + variance[3 * i + 2];
    const double ratio = sqrt(square[i] / expected);
    assert_true(ratio > 0.9 && ratio < 1.1);
  }
  free(space);
}

TEST(test_mend_thousand_samples_hold_volumes_and_conditional_errors) {
  const world *w = *state;
  size_t turned = 0;
  check_mended(w, 0, &turned); /* an assumed volume */
  check_mended(w, STATES - 1, &turned);
  assert_true(turned > 0);
}

/* After a fit of landmarks, covariances are those of kriging with them, and samples have these. */
TEST(test_covariance_after_landmarks_is_that_of_kriging) {
  enum { LANDMARKS = 7 };
  world *w = *state;
  world after = *w;
  float landmarks[4 * LANDMARKS];
  float share[VERTICES];
  supine_kriging_point seen[LANDMARKS];
  double scratch[LANDMARKS];
  double white[2][LANDMARKS];
  double pair[9];
  supine_kriging fit;
  double *kriging = fixture_allocate(supine_kriging_space(LANDMARKS), sizeof *kriging);
  size_t size = 0;
  size_t turned = 0;
  for (size_t i = 0; i < LANDMARKS; ++i) {
    const size_t vertex = i * 6 + 1;
    const float *from = w->fixture->vertex + 3 * vertex;
    const double place[3] = {(double)from[0] * 0.75, (double)from[1], (double)from[2] * 0.5};
    for (size_t k = 0; k < 3; ++k) {
      landmarks[4 * i + k] = (float)place[k];
    }
    landmarks[4 * i + 3] = (float)w->fixture->lung[vertex];
    seen[i] = supine_kriging_landmark(place, w->fixture->lung[vertex]);
  }
  assert_int_equal(supine_kriging_fit_landmarks(LANDMARKS, seen, kriging, &fit, NULL), SUPINE_OK);
  supine_kriging_point at[VERTICES];
  for (size_t i = 0; i < VERTICES; ++i) {
    const float *from = w->fixture->vertex + 3 * i;
    const double place[3] = {(double)from[0], (double)from[1], (double)from[2]};
    at[i] = supine_kriging_landmark(place, w->fixture->lung[i]);
    share[i] = (float)(supine_kriging_share(&fit, &at[i], scratch) / 0.5);
  }
  w->fixture->error_share = share;
  w->fixture->landmarks = landmarks;
  w->fixture->landmark_count = LANDMARKS;
  unsigned char *bytes = fixture_bytes(w->fixture, &size);
  w->fixture->error_share = w->fixture->landmarks = NULL;
  assert_int_equal(supine_basis_open_memory(bytes, size, &after.basis, NULL), SUPINE_OK);
  after.space = fixture_allocate(supine_doubt_space(after.basis, STATES), sizeof *after.space);
  after.doubt = prepare(&after, false, after.space);
  assert_int_equal(
      supine_doubt_covariance(after.doubt, POINTS, after.points, NULL, after.covariance, NULL),
      SUPINE_OK);
  const size_t first = SIZE / STATES * (STATES - 1); /* the displacement is the only term */
  for (size_t i = 0; i < PER_STATE; ++i) {
    for (size_t j = 0; j < PER_STATE; ++j) {
      const supine_kriging_point *two[2] = {&at[w->points[i].vertex], &at[w->points[j].vertex]};
      supine_kriging_whiten(&fit, two[0], white[0]);
      supine_kriging_whiten(&fit, two[1], white[1]);
      supine_kriging_covary(&fit, two[0], white[0], two[1], white[1], pair);
      const double *variance = after.covariance + first * (SIZE + 1);
      const double scale = variance[0] / (0.5 * (double)share[w->points[0].vertex]);
      const double *block = variance + 3 * (i * SIZE + j);
      assert_close(block[0], scale * pair[0], 1e-4 * scale);
      assert_true(block[1] == 0 && pair[1] == 0);
      assert_true(i != j || pair[0] < 0.95);
    }
  }
  check_samples(after.doubt, 1000, POINTS, after.points, "after landmarks");
  check_mended(&after, STATES - 1, &turned);
  supine_basis_close(after.basis);
  free(after.space);
  free(kriging);
  free(bytes);
}

typedef struct sighting {
  const char *what;
  size_t state; /* whose volume is given; the first one for one that is fitted */
  bool fitted, rigid, line;
} sighting;

/* The field of located lungs has the positions and errors that locate states, samples have its
 * covariance, and mended ones the volume that was given. */
TEST_FULL(test_covariance_of_located_lungs_is_that_of_locate) {
  enum { SEEN = 9 };
  static const sighting cases[] = {{"volume given", 3, false, false, false},
                                   {"volume fitted, frame turned", 0, true, true, false},
                                   {"one view", 3, false, false, true}};
  const world *w = *state;
  for (size_t c = 0; c < sizeof cases / sizeof *cases; ++c) {
    supine_observation seen[SEEN];
    supine_locate_residual residuals[SEEN];
    supine_doubt_point points[VERTICES];
    double mean[3 * VERTICES];
    static double covariance[9 * VERTICES * VERTICES];
    float xyz[3 * VERTICES];
    float sigma[VERTICES];
    double scratch[3 * VERTICES];
    supine_pose pose;
    supine_error error;
    const supine_location *found = NULL;
    const supine_doubt *doubt = NULL;
    const supine_doubt_mend *mend = NULL;
    supine_state given = w->states[cases[c].state];
    assert_int_equal(supine_basis_pose(w->basis, &given, &pose, NULL), SUPINE_OK);
    supine_deform(w->basis, &pose, xyz);
    for (size_t j = 0; j < SEEN; ++j) {
      const size_t vertex = j * 4 + 2;
      seen[j] = (supine_observation){.vertex = vertex, .noise = 1.5, .on_line = cases[c].line};
      for (size_t k = 0; k < 3; ++k) {
        const double x = (double)xyz[3 * vertex + k] + (double)((7 * j + 5 * k) % 9) - 4;
        seen[j].from[k] = k == 1 ? -700 : 0;
        seen[j].position[k] = cases[c].line ? seen[j].from[k] + 1.5 * (x - seen[j].from[k]) : x;
      }
    }
    if (cases[c].fitted) {
      given.volume.kind = SUPINE_VOLUME_DEFAULT;
    }
    const supine_locate_task task = {.inside = w->basis,
                                     .count = SEEN,
                                     .observed = seen,
                                     .state = given,
                                     .rigid = cases[c].rigid};
    double *space[3] = {fixture_allocate(supine_locate_space(SEEN), sizeof **space),
                        fixture_allocate(supine_doubt_space(w->basis, 1), sizeof **space),
                        fixture_allocate(supine_doubt_mend_space(w->basis), sizeof **space)};
    assert_int_equal(supine_locate(&task, residuals, space[0], &found, &error), SUPINE_OK);
    assert_int_equal(supine_locate_positions(found, w->basis, xyz, sigma, NULL), SUPINE_OK);
    const supine_doubt_task asked = {.basis = w->basis, .state_count = 1, .location = found};
    assert_int_equal(supine_doubt_prepare(&asked, space[1], &doubt, &error), SUPINE_OK);
    for (size_t i = 0; i < VERTICES; ++i) {
      points[i] = (supine_doubt_point){i, 0};
    }
    assert_int_equal(supine_doubt_covariance(doubt, VERTICES, points, mean, covariance, NULL),
                     SUPINE_OK);
    for (size_t i = 0; i < VERTICES; ++i) {
      double trace = 0;
      for (size_t k = 0; k < 3; ++k) {
        trace += covariance[(3 * i + k) * (3 * VERTICES + 1)];
        assert_close(mean[3 * i + k], (double)xyz[3 * i + k], 1e-4);
      }
      assert_close(sqrt(trace), (double)sigma[i], 1e-3 * (double)sigma[i]);
    }
    check_samples(doubt, 2000, POINTS, points + 5, cases[c].what);
    assert_int_equal(supine_doubt_mend_prepare(doubt, 0, space[2], &mend, NULL), SUPINE_OK);
    for (size_t i = 0; i < 20; ++i) {
      assert_int_equal(supine_doubt_sample(doubt, 0, 3, i, xyz, NULL), SUPINE_OK);
      assert_int_equal(supine_doubt_mend_sample(mend, xyz, NULL), SUPINE_OK);
      const double volume = find_gradient(w, 0, xyz, scratch) + find_gradient(w, 1, xyz, scratch);
      assert_true(cases[c].fitted || fabs(volume - 2e6) < 40);
    }
    for (size_t i = 0; i < 3; ++i) {
      free(space[i]);
    }
  }
}

TEST(test_doubt_wrong_input_refused) {
  world *w = *state;
  supine_error error = {0};
  double space[4000];
  float xyz[3 * VERTICES];
  const supine_doubt *doubt = NULL;
  const supine_doubt_frame *frame = NULL;
  const supine_doubt_point bad[2] = {{VERTICES, 0}, {0, STATES}};
  supine_doubt_task task = {.basis = w->basis, .states = w->states};
  assert_int_equal(supine_doubt_prepare(&task, space, &doubt, &error), SUPINE_ERROR_ARGUMENT);
  assert_says(error.message, "0 states: give 1 to 16");
  for (size_t i = 0; i < 2; ++i) {
    assert_int_equal(supine_doubt_covariance(w->doubt, 1, &bad[i], NULL, w->covariance, &error),
                     SUPINE_ERROR_ARGUMENT);
    assert_says(error.message, "point 1 is vertex");
  }
  assert_int_equal(supine_doubt_sample(w->doubt, STATES, 1, 1, xyz, &error), SUPINE_ERROR_ARGUMENT);
  const supine_doubt_mend *mend = NULL;
  assert_int_equal(supine_doubt_mend_prepare(w->doubt, STATES, space, &mend, &error),
                   SUPINE_ERROR_ARGUMENT);
  assert_says(error.message, "state 4: give one below 4");
  assert_int_equal(
      supine_doubt_frame_prepare(w->doubt, 2, (const size_t[]){1, 2}, space, &frame, &error),
      SUPINE_ERROR_ARGUMENT);
  assert_says(error.message, "2 points of the frame: give 3 to 300");
  assert_int_equal(
      supine_doubt_frame_prepare(w->doubt, 3, (const size_t[]){5, 5, 9}, space, &frame, &error),
      SUPINE_ERROR_ARGUMENT);
  assert_says(error.message, "from one line");
  assert_int_equal(supine_doubt_frame_prepare(w->doubt, 3, (const size_t[]){5, VERTICES, 9}, space,
                                              &frame, &error),
                   SUPINE_ERROR_ARGUMENT);
  assert_says(error.message, "give a vertex below");
  assert_null(frame);
}

TEST_GROUP(setup, teardown)
