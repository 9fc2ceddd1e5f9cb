/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test how lesions and collapse change displacements in the diseased tissue and elsewhere. */
#include <float.h>

#include "precompute/lungs/disease.h"
#include "precompute/physics/solve.h"
#include "tests/helpers/test.h"
#include <supine/volume.h>

#include "tests/helpers/lungs_helpers.h"

static const char *const real_names[] = {"left.obj", "right.obj"};
static const double supine[3] = {0.0, 1.0, 0.0};

static supine_model model;

/* Return stiffness factors of 1 for all vertices (malloc), and make `model` use them. A lesion
 * added later multiplies these factors. */
static double *no_lesions(const supine_lungs *lungs) {
  double *factors = malloc(lungs->mesh.vertex_count * sizeof *factors);
  for (size_t i = 0; i < lungs->mesh.vertex_count; ++i) {
    factors[i] = 1.0;
  }
  model.lesions = factors;
  return factors;
}

static supine_lungs lumps(void) {
  supine_mesh meshes[2] = {helper_lump(9, 80.0, 5), helper_lump(9, -75.0, 6)};
  supine_lungs lungs = {0};
  assert_int_equal(supine_lungs_create(meshes, 2, NULL, &lungs, NULL), SUPINE_OK);
  supine_mesh_free(&meshes[0]);
  supine_mesh_free(&meshes[1]);
  return lungs;
}

static supine_solution solve(const supine_lungs *lungs, const double g[3]) {
  supine_solution solution = {0};
  supine_error error = {0};
  if (supine_physics_solve(lungs, &model, g, &solution, &error) != SUPINE_OK) {
    fail_msg("%s", error.message);
  }
  return solution;
}

static double distance(const double *p, const double *q) {
  return hypot(hypot(p[0] - q[0], p[1] - q[1]), p[2] - q[2]);
}

/* Return the vertex of the left lung that is farthest to the left. */
static const double *side_of(const supine_lungs *lungs) {
  size_t found = 0;
  for (size_t i = 0; i < lungs->mesh.vertex_count; ++i) {
    found = lungs->mesh.vertices[3 * i] > lungs->mesh.vertices[3 * found] ? i : found;
  }
  return lungs->mesh.vertices + 3 * found;
}

/* Smallest and largest ratio of the displacement with a lesion to that without it. */
typedef struct change {
  double inside[2]; /* least and greatest ratio of displacements with and without the lesion, within
                       half its radius */
  double far[2];    /* the same ratios more than 50 mm from the lesion */
} change;

static void widen(double range[2], double value) {
  range[0] = fmin(range[0], value);
  range[1] = fmax(range[1], value);
}

/* Compare the displacements with and without the lesion. Scale both to the volume change `volume`,
 * mL; if it is 0, compare the displacements as solved. */
static change change_by(const supine_lungs *lungs, const supine_lesion *lesion, double volume) {
  supine_solution healthy = solve(lungs, supine);
  double *factors = no_lesions(lungs);
  size_t reached = 0;
  assert_int_equal(supine_lungs_add_lesion(lungs, lesion, factors, &reached, NULL), SUPINE_OK);
  assert_true(reached > 10);
  supine_solution ill = solve(lungs, supine);
  double scale[2] = {1.0, 1.0};
  if (volume != 0.0) {
    assert_int_equal(supine_volume_scale(healthy.cubic, volume, &scale[0], NULL), SUPINE_OK);
    assert_int_equal(supine_volume_scale(ill.cubic, volume, &scale[1], NULL), SUPINE_OK);
  }
  change found = {{INFINITY, -INFINITY}, {INFINITY, -INFINITY}};
  for (size_t i = 0; i < lungs->mesh.vertex_count; ++i) {
    const double r = distance(lungs->mesh.vertices + 3 * i, lesion->centre);
    const double ratio = scale[1] * ill.catch_[i] / (scale[0] * healthy.catch_[i]);
    if (r < 0.5 * lesion->radius) {
      widen(found.inside, ratio);
    } else if (r > lesion->radius + 50.0) {
      widen(found.far, ratio);
    }
  }
  supine_physics_solution_free(&healthy);
  supine_physics_solution_free(&ill);
  free(factors);
  model.lesions = NULL;
  return found;
}

static void check_lesions(const supine_lungs *lungs) {
  const double *side = side_of(lungs);
  static const double factors[] = {2.0, 10.0};
  for (size_t f = 0; f < 2; ++f) {
    const supine_lesion lesion = {{side[0] - 8.0, side[1], side[2]}, 25.0, factors[f]};
    const change scaled = change_by(lungs, &lesion, 0.0);
    const change breathed = change_by(lungs, &lesion, 500.0);
    printf("stiffness factor %2g: displacement with the lesion divided by "
           "displacement "
           "without the lesion: inside %.3f to %.3f; 50 mm away %.6f to %.6f if not scaled, "
           "%.6f to %.6f if both inhale 500 mL\n",
           factors[f], scaled.inside[0], scaled.inside[1], scaled.far[0], scaled.far[1],
           breathed.far[0], breathed.far[1]);
    assert_true(scaled.inside[1] < 0.9);
    assert_true(breathed.inside[1] < 0.9);
    assert_true(scaled.far[0] > 0.99 && scaled.far[1] < 1.01);
    /* A stiff lesion gains less volume. To inhale the same volume, all tissue far from the lesion
     * must move more, by the same factor everywhere. */
    assert_close(breathed.far[1] / breathed.far[0], scaled.far[1] / scaled.far[0], 1e-9);
    const supine_lesion small = {{side[0] - 8.0, side[1], side[2]}, 18.0, factors[f]};
    const change by_small = change_by(lungs, &small, 500.0);
    printf("  lesion with a radius of 18 mm: 50 mm away %.6f to %.6f if both inhale 500 mL\n",
           by_small.far[0], by_small.far[1]);
    assert_true(by_small.inside[1] < 0.9);
    assert_true(by_small.far[0] > 0.99 && by_small.far[1] < 1.01);
  }
  const supine_lesion soft = {{side[0] - 8.0, side[1], side[2]}, 25.0, 0.25};
  assert_true(change_by(lungs, &soft, 500.0).inside[0] > 1.0);
}

TEST(test_lesion_in_real_lungs_changes_only_its_region) {
  model = supine_physics_model(SUPINE_LAW_PAPER);
  supine_lungs lungs = {0};
  if (!helper_real_lungs(real_names, 2, SUPINE_AXES_AUTO, &lungs)) {
    skip();
  }
  check_lesions(&lungs);
  supine_lungs_free(&lungs);
}

/* A large lesion in one lung does not change the other lung, because the stiffness of all tissue is
 * divided by its geometric mean before the factors of lesions are applied. */
TEST(test_lesion_large_other_lung_unchanged) {
  model = supine_physics_model(SUPINE_LAW_PAPER);
  supine_lungs lungs = lumps();
  supine_solution healthy = solve(&lungs, supine);
  const double *side = side_of(&lungs);
  const supine_lesion lesion = {{side[0], side[1], side[2]}, 90.0, 50.0};
  size_t reached = 0;
  double *factors = no_lesions(&lungs);
  assert_int_equal(supine_lungs_add_lesion(&lungs, &lesion, factors, &reached, NULL), SUPINE_OK);
  assert_true(20 * reached > lungs.mesh.vertex_count);
  supine_solution ill = solve(&lungs, supine);
  for (size_t i = lungs.lung_begin[1]; i < lungs.lung_begin[2]; ++i) {
    assert_true(fabs(ill.catch_[i] - healthy.catch_[i]) <= 1e-12 * healthy.catch_[i] + 1e-14);
  }
  supine_physics_solution_free(&healthy);
  supine_physics_solution_free(&ill);
  free(factors);
  supine_lungs_free(&lungs);
}

TEST(test_lesion_factor_one_changes_nothing) {
  model = supine_physics_model(SUPINE_LAW_PAPER);
  supine_lungs lungs = lumps();
  supine_solution healthy = solve(&lungs, supine);
  const double *side = side_of(&lungs);
  const supine_lesion lesion = {{side[0], side[1], side[2]}, 40.0, 1.0};
  double *factors = no_lesions(&lungs);
  assert_int_equal(supine_lungs_add_lesion(&lungs, &lesion, factors, &(size_t){0}, NULL),
                   SUPINE_OK);
  supine_solution same = solve(&lungs, supine);
  assert_memory_equal(same.catch_, healthy.catch_, lungs.mesh.vertex_count * sizeof(double));
  assert_memory_equal(same.cubic, healthy.cubic, sizeof same.cubic);
  supine_physics_solution_free(&healthy);
  supine_physics_solution_free(&same);
  free(factors);
  supine_lungs_free(&lungs);
}

TEST(test_lesion_factors_any_distance_follow_documented_profile) {
  model = supine_physics_model(SUPINE_LAW_PAPER);
  supine_lungs lungs = lumps();
  const double *centre = side_of(&lungs);
  const supine_lesion lesion = {{centre[0], centre[1], centre[2]}, 50.0, 7.0};
  double *factors = no_lesions(&lungs);
  assert_int_equal(supine_lungs_add_lesion(&lungs, &lesion, factors, &(size_t){0}, NULL),
                   SUPINE_OK);
  assert_int_equal(supine_lungs_add_lesion(&lungs, &lesion, factors, &(size_t){0}, NULL),
                   SUPINE_OK);
  size_t seen[3] = {0, 0, 0};
  for (size_t i = 0; i < lungs.mesh.vertex_count; ++i) {
    const double r = distance(lungs.mesh.vertices + 3 * i, centre) / 50.0;
    const double value = factors[i];
    if (r <= 0.5) {
      assert_true(fabs(value - 49.0) <= 64.0 * DBL_EPSILON * 49.0);
      ++seen[0];
    } else if (r >= 1.0) {
      assert_true(value == 1.0);
      ++seen[1];
    } else {
      const double q = 2.0 - 2.0 * r;
      assert_true(fabs(log(value) - 2.0 * log(7.0) * (3.0 - 2.0 * q) * q * q) < 1e-12);
      ++seen[2];
    }
  }
  assert_true(seen[0] > 3 && seen[1] > 3 && seen[2] > 3);
  free(factors);
  supine_lungs_free(&lungs);
}

TEST(test_lesion_outside_lungs_changes_nothing) {
  model = supine_physics_model(SUPINE_LAW_PAPER);
  supine_lungs lungs = lumps();
  supine_solution healthy = solve(&lungs, supine);
  const supine_lesion lesion = {{900.0, 0.0, 0.0}, 40.0, 9.0};
  size_t reached = 1;
  double *factors = no_lesions(&lungs);
  assert_int_equal(supine_lungs_add_lesion(&lungs, &lesion, factors, &reached, NULL), SUPINE_OK);
  assert_int_equal(reached, 0);
  supine_solution same = solve(&lungs, supine);
  assert_memory_equal(same.catch_, healthy.catch_, lungs.mesh.vertex_count * sizeof(double));
  supine_physics_solution_free(&healthy);
  supine_physics_solution_free(&same);
  free(factors);
  supine_lungs_free(&lungs);
}

TEST(test_lesion_bad_numbers_refused) {
  model = supine_physics_model(SUPINE_LAW_PAPER);
  supine_lungs lungs = lumps();
  static const supine_lesion bad[] = {{{NAN, 0, 0}, 10, 2},     {{0, INFINITY, 0}, 10, 2},
                                      {{0, 0, 0}, 0, 2},        {{0, 0, 0}, -1, 2},
                                      {{0, 0, 0}, INFINITY, 2}, {{0, 0, 0}, 10, 0},
                                      {{0, 0, 0}, 10, -3},      {{0, 0, 0}, 10, NAN}};
  for (size_t i = 0; i < sizeof bad / sizeof *bad; ++i) {
    supine_error error = {0};
    double *factors = NULL; /* an invalid lesion is refused before `factors` is read */
    assert_int_equal(supine_lungs_add_lesion(&lungs, &bad[i], factors, &(size_t){0}, &error),
                     SUPINE_ERROR_ARGUMENT);
    assert_says(error.message, "lesion at");
  }
  supine_lungs_free(&lungs);
}

/* Return the volume of one lung, mL, with vertices at these positions. */
static double volume_of(const supine_lungs *lungs, size_t lung, double *vertices) {
  const supine_mesh part = {lungs->mesh.vertex_count, vertices,
                            lungs->triangle_begin[lung + 1] - lungs->triangle_begin[lung],
                            lungs->mesh.triangles + 3 * lungs->triangle_begin[lung]};
  return 1e-3 * supine_mesh_volume(&part);
}

TEST(test_collapse_any_direction_volume_and_breath_scaled) {
  model = supine_physics_model(SUPINE_LAW_PAPER);
  static const double directions[][3] = {{0, 1, 0}, {0, -1, 0}, {1, 0, 0}, {0.48, -0.6, 0.64}};
  const double share = 0.3;
  const double scale = 1.7;
  supine_lungs lungs = lumps();
  const size_t n = lungs.mesh.vertex_count;
  double *collapsed = malloc(3 * n * sizeof *collapsed);
  double *moved = malloc(3 * n * sizeof *moved);
  for (size_t d = 0; d < 4; ++d) {
    double volumes[2][2];
    double gains[2][2];
    double cubic[2];
    for (int ill = 0; ill < 2; ++ill) {
      model.share[0] = ill == 1 ? share : 1.0;
      supine_solution solution = solve(&lungs, directions[d]);
      supine_lungs_collapse(&lungs, model.share, lungs.mesh.vertices, collapsed);
      supine_physics_solution_apply(&solution, &lungs.mesh, scale, moved);
      supine_lungs_collapse(&lungs, model.share, moved, moved);
      for (size_t lung = 0; lung < 2; ++lung) {
        volumes[ill][lung] = volume_of(&lungs, lung, collapsed);
        gains[ill][lung] = volume_of(&lungs, lung, moved) - volumes[ill][lung];
      }
      cubic[ill] =
          scale * (solution.cubic[0] + scale * (solution.cubic[1] + scale * solution.cubic[2]));
      supine_physics_solution_free(&solution);
    }
    for (size_t lung = 0; lung < 2; ++lung) {
      const double wanted = lung == 0 ? share : 1.0;
      assert_true(fabs(volumes[1][lung] - wanted * volumes[0][lung]) < 1e-12 * volumes[0][lung]);
      assert_true(fabs(gains[1][lung] - wanted * gains[0][lung]) < 1e-10 * volumes[0][lung]);
    }
    assert_true(gains[0][0] > 1.0);
    assert_true(fabs(cubic[1] - gains[1][0] - gains[1][1]) < 1e-9 * volumes[0][0]);
  }
  free(collapsed);
  free(moved);
  supine_lungs_free(&lungs);
}

/* A collapsed lung has shrunk towards a fixed point, the mean of the vertices of its hilum. A lung
 * that moves is collapsed about its hilum where that is then. */
TEST(test_collapse_fixed_point_at_hilum_of_the_state) {
  model = supine_physics_model(SUPINE_LAW_PAPER);
  supine_lungs lungs = lumps();
  const size_t n = lungs.mesh.vertex_count;
  const double *p = lungs.mesh.vertices;
  const double share[2] = {0.3, 0.6};
  double *collapsed = malloc(3 * n * sizeof *collapsed);
  double *moved = malloc(3 * n * sizeof *moved);
  for (size_t i = 0; i < 3 * n; ++i) {
    moved[i] = 1.1 * p[i] + 0.002 * p[i / 3 * 3] * p[i / 3 * 3 + 1] + (double)(i % 3);
  }
  supine_lungs_collapse(&lungs, share, moved, collapsed);
  for (size_t lung = 0; lung < 2; ++lung) {
    const size_t begin = lungs.lung_begin[lung];
    const size_t end = lungs.lung_begin[lung + 1];
    double low[3] = {INFINITY, INFINITY, INFINITY};
    double high[3] = {-INFINITY, -INFINITY, -INFINITY};
    double mean[3] = {0.0, 0.0, 0.0};
    double count = 0.0;
    for (size_t i = 3 * begin; i < 3 * end; ++i) {
      low[i % 3] = fmin(low[i % 3], p[i]);
      high[i % 3] = fmax(high[i % 3], p[i]);
    }
    for (size_t i = begin; i < end; ++i) {
      const double *q = p + 3 * i;
      const double x = (q[0] - low[0]) / (high[0] - low[0]);
      if ((lung == 0 ? x : 1.0 - x) < 0.35 &&
          fabs(q[1] - 0.5 * (low[1] + high[1])) < 0.2 * (high[1] - low[1]) &&
          fabs(q[2] - 0.5 * (low[2] + high[2])) < 0.2 * (high[2] - low[2])) {
        count += 1.0;
        for (size_t k = 0; k < 3; ++k) {
          mean[k] += moved[3 * i + k];
        }
      }
    }
    const double length = cbrt(share[lung]);
    const size_t any = begin + 5;
    assert_true(count > 5.0);
    for (size_t k = 0; k < 3; ++k) {
      const double fixed = (collapsed[3 * any + k] - length * moved[3 * any + k]) / (1.0 - length);
      assert_close(fixed, mean[k] / count, 1e-9);
    }
  }
  free(collapsed);
  free(moved);
  supine_lungs_free(&lungs);
}

TEST(test_collapse_real_lung_shrinks_towards_midline) {
  model = supine_physics_model(SUPINE_LAW_PAPER);
  supine_lungs lungs = {0};
  if (!helper_real_lungs(real_names, 2, SUPINE_AXES_AUTO, &lungs)) {
    skip();
  }
  model.share[1] = 0.25;
  double *collapsed = malloc(3 * lungs.mesh.vertex_count * sizeof *collapsed);
  supine_lungs_collapse(&lungs, model.share, lungs.mesh.vertices, collapsed);
  double outer[2] = {0.0, 0.0};
  for (size_t i = 0; i < lungs.mesh.vertex_count; ++i) {
    for (size_t k = 0; k < 3; ++k) {
      if (i < lungs.lung_begin[1]) {
        assert_true(collapsed[3 * i + k] == lungs.mesh.vertices[3 * i + k]);
      }
      assert_true(collapsed[3 * i + k] >= lungs.minimum[k] &&
                  collapsed[3 * i + k] <= lungs.maximum[k]);
    }
    outer[0] = fmin(outer[0], lungs.mesh.vertices[3 * i]);
    outer[1] = fmin(outer[1], collapsed[3 * i]);
  }
  assert_true(outer[1] > outer[0] + 20.0); /* mm between the chest wall and the collapsed lung */
  free(collapsed);
  supine_lungs_free(&lungs);
}
