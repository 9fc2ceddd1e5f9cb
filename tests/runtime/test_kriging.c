/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test kriging. The formula for leaving a point out equals a fit without the point. For data drawn
 * from the kriging model, the predicted error is correct. */
#include "runtime/kriging.h"
#include "tests/helpers/test.h"

#include "tests/helpers/runtime_fixture.h"

enum { SEEN = 20, UNSEEN = 180, ALL = SEEN + UNSEEN };

static double normal(uint64_t *state) {
  double sum = 0;
  for (int i = 0; i < 12; ++i) {
    sum += 0.5 * fixture_random(state);
  }
  return sum;
}

/* Choose random points in two lungs, displaced by up to 40 mm. Kriging corrects these
 * displacements. */
static void place(uint64_t *seed, size_t count, supine_kriging_point *points) {
  for (size_t j = 0; j < count; ++j) {
    supine_kriging_point *p = &points[j];
    *p = (supine_kriging_point){.noise = 1};
    p->lung = fixture_random(seed) > 0;
    for (size_t i = 0; i < 3; ++i) {
      const double half[3] = {45, 80, 120};
      p->position[i] = half[i] * fixture_random(seed) + (i == 0 ? (p->lung ? 80 : -80) : 0);
    }
    const double down = 20 - p->position[2] / 6;
    p->size = down;
    p->volume[0] = 0;
    p->volume[1] = -0.1 * down;
    p->volume[2] = -0.3 * down;
  }
}

/* Set the direction of a point's line to a random unit vector. */
static void aim(uint64_t *seed, supine_kriging_point *p) {
  double square = 0;
  p->on_line = true;
  for (size_t i = 0; i < 3; ++i) {
    p->direction[i] = fixture_random(seed) + 0.1;
    square += p->direction[i] * p->direction[i];
  }
  for (size_t i = 0; i < 3; ++i) {
    p->direction[i] /= sqrt(square);
  }
}

/* Set the residuals of the points, mm, to random data of the kriging model: the sum of a
 * translation (terms 0 to 2), a change of volume (term 3), a rotation (terms 4 to 6) and a sample
 * of the Gaussian process. */
static void draw(uint64_t *seed, size_t count, supine_kriging_point *points, const double *terms) {
  double *factor = fixture_allocate(count * count, sizeof *factor);
  double *white = fixture_allocate(count, sizeof *white);
  for (size_t i = 0; i < count; ++i) {
    for (size_t j = 0; j <= i; ++j) {
      const supine_kriging_point *p = &points[i];
      const supine_kriging_point *q = &points[j];
      factor[i * count + j] = supine_kriging_covariance(
          &supine_kriging_default, p->position, p->size, q->position, q->size, p->lung == q->lung);
    }
    factor[i * count + i] += 1e-6;
  }
  assert_true(supine_kriging_factor(count, factor));
  for (size_t axis = 0; axis < 3; ++axis) {
    for (size_t j = 0; j < count; ++j) {
      white[j] = normal(seed);
    }
    for (size_t j = 0; j < count; ++j) {
      const double *p = points[j].position;
      double sum = terms[axis] + terms[3] * points[j].volume[axis] +
                   terms[4 + (axis + 1) % 3] * p[(axis + 2) % 3] -
                   terms[4 + (axis + 2) % 3] * p[(axis + 1) % 3];
      for (size_t k = 0; k <= j; ++k) {
        sum += factor[j * count + k] * white[k];
      }
      points[j].residual[axis] = sum;
    }
  }
  free(factor);
  free(white);
}

static void predict(const supine_kriging *fit, const supine_kriging_point *p, float shift[3],
                    float *variance) {
  const float position[3] = {(float)p->position[0], (float)p->position[1], (float)p->position[2]};
  const float volume[3] = {(float)p->volume[0], (float)p->volume[1], (float)p->volume[2]};
  const float size = (float)p->size;
  const supine_kriging_target target = {
      .count = 1, .lung = p->lung, .position = position, .size = &size, .volume = volume};
  supine_kriging_predict(fit, &target, shift, variance);
}

TEST(test_kriging_leave_out_equals_fit_without_the_point) {
  uint64_t seed = 71;
  supine_kriging_point points[SEEN];
  const double terms[7] = {12, -7, 20, 0.8, 0.02, -0.01, 0.03};
  place(&seed, SEEN, points);
  draw(&seed, SEEN, points, terms);
  double *space = fixture_allocate(supine_kriging_space(SEEN), sizeof *space);
  double *other_space = fixture_allocate(supine_kriging_space(SEEN), sizeof *space);
  for (int kind = 0; kind < 3; ++kind) {
    const supine_kriging_options unknown = {.model = supine_kriging_default,
                                            .volume = kind > 0,
                                            .rotation = kind > 1,
                                            .volume_mean = kind > 0 ? 0.4 : 0};
    supine_kriging fit;
    supine_kriging without;
    assert_int_equal(supine_kriging_fit(&unknown, SEEN, points, space, &fit, NULL), SUPINE_OK);
    double left[3];
    double scratch[16 * SEEN];
    const double sigma = supine_kriging_leave_out(&fit, 1, &(size_t){SEEN - 1}, left, scratch);
    assert_int_equal(supine_kriging_fit(&unknown, SEEN - 1, points, other_space, &without, NULL),
                     SUPINE_OK);
    float shift[3];
    float variance = 0;
    predict(&without, &points[SEEN - 1], shift, &variance);
    assert_true(fabs(sigma - sqrt((double)variance + 3)) < 1e-3);
    for (size_t i = 0; i < 3; ++i) {
      assert_true(fabs(left[i] - points[SEEN - 1].residual[i] + (double)shift[i]) < 1e-3);
    }
  }
  free(space);
  free(other_space);
}

/* Three lines of unit noise at right angles see each coordinate twice: they equal a point of noise
 * sqrt(1/2), wherever on its line each position is. */
TEST(test_kriging_three_lines_at_right_angles_equal_a_point) {
  enum { TRIPLES = 6 };
  uint64_t seed = 23;
  supine_kriging_point points[TRIPLES + 1];
  supine_kriging_point lines[3 * TRIPLES];
  const double terms[7] = {3, -2, 8, 0.4, 0.02, -0.01, 0.03};
  place(&seed, TRIPLES + 1, points);
  draw(&seed, TRIPLES + 1, points, terms);
  double *space = fixture_allocate(supine_kriging_space(TRIPLES), sizeof *space);
  double *other_space = fixture_allocate(supine_kriging_space(3 * TRIPLES), sizeof *space);
  const supine_kriging_options options = {.model = supine_kriging_default,
                                          .volume = true,
                                          .rotation = true,
                                          .volume_mean = 0.3,
                                          .rotation_deviation = 0.05,
                                          .axis = {0.6, 0, 0.8},
                                          .axis_mean = 2,
                                          .axis_deviation = 5};
  for (size_t j = 0; j < 3 * (size_t)TRIPLES; ++j) {
    lines[j] = points[j / 3];
    lines[j].on_line = true;
    lines[j].direction[j % 3] = 1;
    lines[j].residual[j % 3] += 40 * fixture_random(&seed);
  }
  for (size_t j = 0; j < TRIPLES; ++j) {
    points[j].noise = sqrt(0.5);
  }
  supine_kriging by_points;
  supine_kriging by_lines;
  assert_int_equal(supine_kriging_fit(&options, TRIPLES, points, space, &by_points, NULL),
                   SUPINE_OK);
  assert_int_equal(supine_kriging_fit(&options, 3 * TRIPLES, lines, other_space, &by_lines, NULL),
                   SUPINE_OK);
  for (size_t k = 0; k < SUPINE_KRIGING_TERMS; ++k) {
    assert_true(fabs(by_points.terms[k] - by_lines.terms[k]) < 1e-6);
    for (size_t l = 0; l < SUPINE_KRIGING_TERMS; ++l) {
      assert_true(fabs(by_points.covariance[k][l] - by_lines.covariance[k][l]) < 1e-6);
    }
  }
  for (size_t j = 0; j <= TRIPLES; ++j) { /* observed points and one that was not */
    float shift[2][3];
    float variance[2];
    predict(&by_points, &points[j], shift[0], &variance[0]);
    predict(&by_lines, &points[j], shift[1], &variance[1]);
    assert_true(fabs((double)(variance[0] - variance[1])) < 1e-3 * (double)variance[0]);
    for (size_t i = 0; i < 3; ++i) {
      assert_true(fabs((double)(shift[0][i] - shift[1][i])) < 1e-3);
    }
  }
  free(space);
  free(other_space);
}

/* What a fit says of a line that it leaves out, with up to two other points, is what a fit without
 * them says across it. */
TEST(test_kriging_leave_out_line_equals_fit_without_the_line) {
  uint64_t seed = 31;
  supine_kriging_point points[SEEN];
  const double terms[7] = {12, -7, 20, 0.8, 0.02, -0.01, 0.03};
  place(&seed, SEEN, points);
  draw(&seed, SEEN, points, terms);
  for (size_t j = 0; j < SEEN; j += 2) {
    aim(&seed, &points[j]);
  }
  aim(&seed, &points[SEEN - 1]);
  double *space = fixture_allocate(supine_kriging_space(SEEN), sizeof *space);
  double *other_space = fixture_allocate(supine_kriging_space(SEEN), sizeof *space);
  const supine_kriging_options options = {.model = supine_kriging_default, .volume = true};
  supine_kriging fit;
  supine_kriging without;
  double left[3];
  double scratch[16 * SEEN];
  assert_int_equal(supine_kriging_fit(&options, SEEN, points, space, &fit, NULL), SUPINE_OK);
  for (size_t out = 1; out < 4; ++out) {
    const double sigma = supine_kriging_leave_out(
        &fit, out, (size_t[]){SEEN - 1, SEEN - 2, SEEN - 3}, left, scratch);
    assert_int_equal(supine_kriging_fit(&options, SEEN - out, points, other_space, &without, NULL),
                     SUPINE_OK);
    const supine_kriging_point *p = &points[SEEN - 1];
    float shift[3];
    float variance = 0;
    double along = 0;
    predict(&without, p, shift, &variance);
    for (size_t i = 0; i < 3; ++i) {
      along += p->direction[i] * (p->residual[i] - (double)shift[i]);
    }
    assert_true(sigma * sigma < (double)variance + 2 && sigma > 1);
    for (size_t i = 0; i < 3; ++i) {
      const double across = p->residual[i] - (double)shift[i] - along * p->direction[i];
      assert_true(fabs(left[i] - across) < 2e-3);
    }
  }
  free(space);
  free(other_space);
}

static int by_value(const void *a, const void *b) {
  const double x = *(const double *)a;
  const double y = *(const double *)b;
  return (x > y) - (x < y);
}

TEST(test_kriging_data_drawn_from_model_error_as_stated) {
  enum { SEEDS = 30 };
  double ratio[SEEDS];
  double held = 0;
  supine_kriging_point *points = fixture_allocate(ALL, sizeof *points);
  double *space = fixture_allocate(supine_kriging_space(SEEN), sizeof *space);
  for (uint64_t s = 0; s < SEEDS; ++s) {
    uint64_t seed = 1000 + 77 * s;
    double terms[7] = {12, -7, 20, normal(&seed), 0.02, -0.01, 0.03};
    place(&seed, ALL, points);
    draw(&seed, ALL, points, terms);
    for (size_t j = 0; j < (size_t)3 * SEEN; ++j) {
      points[j / 3].residual[j % 3] += normal(&seed);
    }
    supine_kriging fit;
    assert_int_equal(supine_kriging_fit(&(supine_kriging_options){.model = supine_kriging_default,
                                                                  .volume = true,
                                                                  .rotation = s % 2 == 0},
                                        SEEN, points, space, &fit, NULL),
                     SUPINE_OK);
    double stated = 0;
    double truth = 0;
    for (size_t j = SEEN; j < ALL; ++j) {
      float shift[3];
      float variance = 0;
      double square = 0;
      predict(&fit, &points[j], shift, &variance);
      for (size_t i = 0; i < 3; ++i) {
        const double e = points[j].residual[i] - (double)shift[i];
        square += e * e;
      }
      stated += (double)variance;
      truth += square;
      held += square <= 1.8 * 1.8 * (double)variance ? 1.0 / (SEEDS * UNSEEN) : 0;
    }
    ratio[s] = sqrt(stated / truth);
  }
  qsort(ratio, SEEDS, sizeof *ratio, by_value);
  print_message(
      "predicted RMS error divided by true RMS error: median %.2f, range %.2f to %.2f; share of "
      "points that err by at most 1.8 predicted errors: %.3f\n",
      ratio[SEEDS / 2], ratio[0], ratio[SEEDS - 1], held);
  assert_in_range((int)(100 * ratio[SEEDS / 2]), 75, 135);
  assert_in_range((int)(100 * held), 93, 99);
  free(points);
  free(space);
}

TEST(test_kriging_one_or_repeated_points_positive_definite) {
  uint64_t seed = 5;
  supine_kriging_point points[12];
  double *space = fixture_allocate(supine_kriging_space(12), sizeof *space);
  place(&seed, 12, points);
  for (size_t j = 0; j < 12; ++j) {
    points[j] = points[0];
    points[j].residual[0] = 5 * fixture_random(&seed);
  }
  for (size_t count = 1; count <= 12; ++count) {
    supine_kriging fit;
    assert_int_equal(supine_kriging_fit(
                         &(supine_kriging_options){.model = supine_kriging_default, .volume = true},
                         count, points, space, &fit, NULL),
                     SUPINE_OK);
    float shift[3];
    float variance = 0;
    double left[3];
    double scratch[16 * 12];
    predict(&fit, &points[0], shift, &variance);
    assert_true(isfinite((double)shift[0]) && variance > 0);
    assert_true(variance <= 3.01F); /* sum over 3 axes of an observation's variance, 1 mm^2 */
    assert_int_equal(supine_kriging_leave_out(&fit, 1, &(size_t){0}, left, scratch) > 0, count > 1);
  }
  points[1].noise = points[0].noise = 0;
  supine_kriging fit;
  supine_error error;
  assert_int_equal(supine_kriging_fit(&(supine_kriging_options){.model = supine_kriging_default}, 2,
                                      points, space, &fit, &error),
                   SUPINE_ERROR_NUMERICAL);
  free(space);
}

/* Of one place with noise n, 1 / (1 + n) of the variance is known there, r^2 / (1 + n) where the
 * correlation is r, and nothing far away or, with r / 3, in the other lung. */
TEST(test_kriging_share_one_place_equals_formula) {
  const double place[3] = {10, -20, 30};
  const supine_kriging_point seen = supine_kriging_landmark(place, 0);
  double *space = fixture_allocate(supine_kriging_space(1), sizeof *space);
  double scratch = 0;
  supine_kriging fit;
  assert_int_equal(supine_kriging_fit_landmarks(1, &seen, space, &fit, NULL), SUPINE_OK);
  for (size_t lung = 0; lung < 2; ++lung) {
    for (int far = 0; far < 400; far += 45) {
      const double there[3] = {10, -20 + far, 30};
      const supine_kriging_point at = supine_kriging_landmark(there, lung);
      const double a = sqrt(3.0) * far / 90;
      const double r = (1 + a) * exp(-a) / (lung == 0 ? 1 : 3);
      assert_close(supine_kriging_share(&fit, &at, &scratch), 1 - r * r / 1.1, 1e-12);
    }
  }
  free(space);
}

static double share_of(size_t count, const supine_kriging_point *seen,
                       const supine_kriging_point *at) {
  double *space = fixture_allocate(supine_kriging_space(count), sizeof *space);
  double scratch[2];
  supine_kriging fit;
  assert_int_equal(supine_kriging_fit_landmarks(count, seen, space, &fit, NULL), SUPINE_OK);
  const double share = supine_kriging_share(&fit, at, scratch);
  free(space);
  return share;
}

/* A second place elsewhere lowers every share, and two at one place count as one with half the
 * noise. */
TEST(test_kriging_share_more_places_leave_less) {
  const double places[3][3] = {{0, 0, 0}, {40, 0, 0}, {15, 20, 0}};
  const supine_kriging_point seen[2] = {supine_kriging_landmark(places[0], 0),
                                        supine_kriging_landmark(places[1], 0)};
  const supine_kriging_point twice[2] = {seen[0], seen[0]};
  const supine_kriging_point at = supine_kriging_landmark(places[2], 0);
  const double one = share_of(1, seen, &at);
  const double two = share_of(2, seen, &at);
  assert_true(two > 0 && two < 0.9 * one && one < 1);
  assert_close(share_of(2, twice, &seen[0]), 0.05 / 1.05, 1e-12);
}

TEST(test_kriging_rotation_of_collinear_points_refused) {
  uint64_t seed = 9;
  supine_kriging_point points[4];
  double space[4 * 30];
  assert_int_equal(supine_kriging_space(4), sizeof space / sizeof *space);
  place(&seed, 4, points);
  supine_kriging fit;
  supine_error error;
  const supine_kriging_options turned = {.model = supine_kriging_default, .rotation = true};
  assert_int_equal(supine_kriging_fit(&turned, 4, points, space, &fit, &error), SUPINE_OK);
  for (size_t j = 0; j < 4; ++j) {
    for (size_t i = 0; i < 3; ++i) {
      points[j].position[i] = (double)j * (double)(i + 1) * 10;
    }
  }
  assert_int_equal(supine_kriging_fit(&turned, 4, points, space, &fit, &error),
                   SUPINE_ERROR_ARGUMENT);
}
