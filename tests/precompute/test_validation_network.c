/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compare a sheet and a ring ([Santhanam2008] Figs. 7 to 9) with a mass-spring-damper system
 * integrated until it is at rest. */
#include "tests/helpers/test.h"
#include "tests/helpers/validation.h"

/* A plane sheet moves like a mass-spring-damper system ([Santhanam2008] Fig. 8). */
TEST(test_solve_plane_equals_mass_spring_damper) {
  frame f = frame_plane(21, 10.0);
  const size_t n = f.mesh.vertex_count;
  double *force = plane_force(&f);
  double *stiffness = ones(n);
  double *ours = calloc(n, sizeof *ours);
  double *theirs = calloc(n, sizeof *theirs);
  assert_int_equal(frame_solve(&f, NULL, force, ours), SUPINE_OK);
  mass_spring_damper system = damper_create(&f, stiffness, force);
  assert_true(damper_integrate(&system, stiffness, 40.0, 1, theirs, NULL, NULL));
  const double difference = relative_rms(n, ours, theirs);
  printf("sheet of %zu masses: difference from a mass-spring-damper system at rest %.2e %% RMS\n",
         n, 100.0 * difference);
  assert_true(difference < 1e-6); /* tolerance of the integration */
  double middle = 0.0;
  double corner = ours[0];
  for (size_t i = 0; i < n; ++i) {
    middle = fmax(middle, ours[i]);
  }
  assert_true(middle > 5.0 * corner); /* the displacement varies over the sheet */
  damper_free(&system);
  frame_free(&f);
  free(force);
  free(stiffness);
  free(ours);
  free(theirs);
}

/* A sheet with springs of unequal length and stiffness that varies fourfold also moves like a
 * mass-spring-damper system. */
TEST(test_solve_irregular_plane_equals_mass_spring_damper) {
  frame f = frame_plane(15, 7.0);
  const size_t n = f.mesh.vertex_count;
  double *stiffness = calloc(n, sizeof *stiffness);
  for (size_t i = 0; i < n; ++i) {
    f.mesh.vertices[3 * i] += 2.5 * sin(7.0 * (double)i);
    f.mesh.vertices[3 * i + 2] = 3.0 * cos(5.0 * (double)i);
    stiffness[i] = exp(0.7 * sin(3.0 * (double)i));
  }
  normalise_stiffness(n, stiffness);
  double *force = plane_force(&f);
  double *ours = calloc(n, sizeof *ours);
  double *theirs = calloc(n, sizeof *theirs);
  assert_int_equal(frame_solve(&f, stiffness, force, ours), SUPINE_OK);
  mass_spring_damper system = damper_create(&f, stiffness, force);
  assert_true(damper_integrate(&system, stiffness, 60.0, 1, theirs, NULL, NULL));
  const double difference = relative_rms(n, ours, theirs);
  printf("irregular sheet: difference %.2e %% RMS\n", 100.0 * difference);
  assert_true(difference < 1e-6);
  damper_free(&system);
  frame_free(&f);
  free(force);
  free(stiffness);
  free(ours);
  free(theirs);
}

/* A uniform ring expands into a circle ([Santhanam2008] Fig. 9). */
TEST(test_solve_uniform_ring_stays_circle) {
  enum { COUNT = 60 };
  frame f = frame_ring(COUNT, 50.0);
  double *force = ones(COUNT);
  double catch_[COUNT] = {0.0};
  assert_int_equal(frame_solve(&f, NULL, force, catch_), SUPINE_OK);
  double least_radius = INFINITY;
  double largest_radius = 0.0;
  for (size_t i = 0; i < COUNT; ++i) {
    const double *p = f.mesh.vertices + 3 * i;
    const double scale = 10.0;
    const double before = hypot(p[0], p[1]);
    const double x = p[0] + scale * catch_[i] * p[0] / before;
    const double y = p[1] + scale * catch_[i] * p[1] / before;
    least_radius = fmin(least_radius, hypot(x, y));
    largest_radius = fmax(largest_radius, hypot(x, y));
  }
  assert_true(least_radius > 51.0); /* initial radius: 50 mm */
  assert_true(largest_radius - least_radius <= 1e-10);
  free(force);
  frame_free(&f);
}

TEST(test_solve_mixed_ring_stiff_part_moves_less) {
  enum { COUNT = 60 };
  static const double factors[] = {0.25, 0.5, 1.0, 2.0, 4.0, 8.0};
  frame f = frame_ring(COUNT, 50.0);
  double *force = ones(COUNT);
  double last = INFINITY;
  for (size_t k = 0; k < 6; ++k) {
    double *stiffness = ring_stiffness(COUNT, factors[k]);
    double catch_[COUNT] = {0.0};
    assert_int_equal(frame_solve(&f, stiffness, force, catch_), SUPINE_OK);
    const double middle = catch_[COUNT / 2];
    const double opposite = catch_[0];
    printf("ring with a third %g times as stiff: the third moves %.4f, the opposite side %.4f\n",
           factors[k], middle, opposite);
    for (size_t i = 0; i < COUNT; ++i) {
      /* catch_ is the outward displacement: every point moves outwards, as on a balloon. */
      assert_true(catch_[i] > 0.0);
    }
    assert_true(middle / opposite < last);
    assert_true(factors[k] == 1.0 ? fabs(middle / opposite - 1.0) < 1e-10
                                  : (middle < opposite) == (factors[k] > 1.0));
    last = middle / opposite;
    free(stiffness);
  }
  free(force);
  frame_free(&f);
}

static void count_steps(void *context, size_t steps, double held) {
  (void)held;
  *(size_t *)context = steps;
}

/* To reach an error of 1e-6, the Pitcher/Catcher solver of [Santhanam2008] (Fig. 7) visits spring
 * ends less often than the mass-spring-damper system. */
TEST(test_pitcher_catcher_converges_before_mass_spring_damper) {
  frame f = frame_plane(15, 10.0);
  const size_t n = f.mesh.vertex_count;
  double *force = plane_force(&f);
  double *stiffness = ones(n);
  double *exact = calloc(n, sizeof *exact);
  double *found = calloc(n, sizeof *found);
  size_t distributions = 0;
  assert_int_equal(frame_solve(&f, NULL, force, exact), SUPINE_OK);
  assert_int_equal(supine_physics_pitcher_catcher(&f.mesh, &f.topology, NULL, force, 1e-7, found,
                                                  count_steps, &distributions, NULL),
                   SUPINE_OK);
  assert_true(relative_rms(n, found, exact) < 1e-6);
  mass_spring_damper system = damper_create(&f, stiffness, force);
  assert_true(damper_integrate(&system, stiffness, 25.0, 1, found, NULL, NULL));
  assert_true(relative_rms(n, found, exact) < 1e-6);
  const size_t links = 2 * f.topology.edge_count;
  const size_t work[2] = {distributions * 4 * f.topology.edge_count / (n + f.topology.edge_count),
                          system.evaluations * links};
  printf("link visits to an error of 1e-6: Pitcher/Catcher %zu, mass-spring-damper %zu\n", work[0],
         work[1]);
  assert_true(work[0] < work[1]);
  damper_free(&system);
  frame_free(&f);
  free(force);
  free(stiffness);
  free(exact);
  free(found);
}
