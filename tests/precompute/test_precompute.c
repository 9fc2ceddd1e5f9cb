/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compare bases of lungs with the full physics: coefficients, stated errors and volumes. */
#include "precompute/lungs/phantom.h"
#include "precompute/physics/solve.h"
#include "precompute/precompute.h"
#include "precompute/projection/projection.h"
#include "sh/expansion.h"
#include "tests/helpers/basis_helpers.h"
#include "tests/helpers/test.h"
#include <supine/runtime.h>
#include <supine/safetensors.h>
#include <supine/sh.h>
#include <supine/volume.h>

#include "tests/helpers/full_operator.h"
#include "tests/helpers/lungs_helpers.h"

#include "tests/helpers/poses.h"

static char folder[] = "/tmp/supine-precompute-XXXXXX";
static char path[64];

static int setup(void **state) {
  (void)state;
  if (mkdtemp(folder) == NULL) {
    return -1;
  }
  (void)snprintf(path, sizeof path, "%s/basis.safetensors", folder);
  return 0;
}

static int teardown(void **state) {
  (void)state;
  (void)unlink(path);
  return rmdir(folder); /* fails if a temporary file is left */
}

static supine_lungs phantom(size_t vertices) {
  supine_mesh mesh = {0};
  supine_lungs lungs = {0};
  assert_int_equal(supine_lungs_phantom_create(vertices, 2500.0, &mesh, NULL), SUPINE_OK);
  assert_int_equal(supine_lungs_create(&mesh, 1, NULL, &lungs, NULL), SUPINE_OK);
  supine_mesh_free(&mesh);
  return lungs;
}

/* Load both lungs of examples/lungs. */
static supine_lungs real_pair(void) {
  static const char *const names[] = {"left.obj", "right.obj"};
  supine_lungs lungs = {0};
  if (!helper_real_lungs(names, 2, SUPINE_AXES_AUTO, &lungs)) {
    skip(); /* skip() does not return */
  }
  return lungs;
}

/* Distance over which forces spread, mm. If 0, only neighbours exchange force, as in
 * [Santhanam2008]. */
static double reach;

static supine_basis_report make_basis(const supine_lungs *lungs, size_t band, size_t modes,
                                      double soften, size_t held_out) {
  supine_prepared prepared = {.source = {.lungs = *lungs},
                              .model = supine_physics_model(SUPINE_LAW_PAPER)};
  const supine_basis_choice choice = {.band = band, .modes = modes, .held_out = held_out};
  prepared.model.force.soften = soften;
  prepared.model.reach = soften != 0.0 ? 10.0 : reach;
  supine_basis_report report;
  supine_error error;
  if (helper_write_basis(path, &prepared, &choice, &report, &error) != SUPINE_OK) {
    fail_msg("%s", error.message);
  }
  return report;
}

/* Open the basis without quantisation, which would add to the measured errors. */
static supine_basis *open_basis(void) {
  const supine_basis_options exact = {sizeof exact, .storage = SUPINE_STORAGE_EXACT};
  supine_basis *basis = NULL;
  supine_error error;
  if (supine_basis_open_with(path, &exact, &basis, &error) != SUPINE_OK) {
    fail_msg("%s", error.message);
  }
  return basis;
}

/* Compare the coefficients in the file with those from a direct factorisation of the equilibrium
 * matrix, with one right-hand side for each harmonic. */
static void check_coefficients(const char *const *names, supine_axes axes) {
  enum { BAND = 3, TERMS = 16, LATITUDES = 32 };
  supine_lungs lungs = {0};
  if (!helper_real_lungs(names, 2, axes, &lungs)) {
    skip();
    return;
  }
  const size_t n = lungs.mesh.vertex_count;
  (void)make_basis(&lungs, BAND, 0, 0.0, 0);
  supine_sh_grid *grid = NULL;
  assert_int_equal(supine_sh_grid_create(LATITUDES, 2 * LATITUDES, &grid), SUPINE_OK);
  double *projected = calloc(TERMS * n, sizeof *projected);
  double *force = malloc(n * sizeof *force);
  /* The force is linear in position, so four moments give its projection onto a harmonic. */
  double moments[TERMS][4] = {{0.0}};
  for (size_t d = 0; d < 2 * LATITUDES * LATITUDES; ++d) {
    double g[3];
    double y[TERMS];
    double low = INFINITY;
    double high = -INFINITY;
    supine_sh_grid_direction(grid, d / (2 * LATITUDES), d % (2 * LATITUDES), g);
    assert_int_equal(supine_sh_evaluate(BAND, g, y), SUPINE_OK);
    assert_int_equal(supine_physics_height_range(&lungs, false, 1, g, &low, &high), SUPINE_OK);
    const double weight = grid->weight[d / (2 * LATITUDES)] * M_PI / LATITUDES;
    for (size_t t = 0; t < TERMS; ++t) {
      moments[t][0] -= weight * y[t] * low / (high - low);
      for (size_t k = 0; k < 3; ++k) {
        moments[t][1 + k] += weight * y[t] * g[k] / (high - low);
      }
    }
  }
  for (size_t t = 0; t < TERMS; ++t) {
    for (size_t i = 0; i < n; ++i) {
      const double *p = lungs.mesh.vertices + 3 * i;
      projected[t * n + i] =
          moments[t][0] + moments[t][1] * p[0] + moments[t][2] * p[1] + moments[t][3] * p[2];
    }
  }
  double *ones = malloc(n * sizeof *ones);
  for (size_t i = 0; i < n; ++i) {
    ones[i] = 1.0;
  }
  full_operator op = full_operator_create(&lungs.mesh, &lungs.topology, ones);
  direct_solver direct = direct_solver_create(&op);
  supine_safetensors *file = NULL;
  assert_int_equal(supine_safetensors_open(path, &file, NULL), SUPINE_OK);
  const float *coefficients = supine_safetensors_find(file, "coefficients")->data;
  double largest = 0.0;
  double worst = 0.0;
  for (size_t t = 0; t < TERMS; ++t) {
    direct_solver_solve(&direct, &op, n, projected + t * n, force);
    for (size_t i = 0; i < n; ++i) {
      largest = fmax(largest, fabs(force[i]));
      worst = fmax(worst, fabs(force[i] - (double)coefficients[i * TERMS + t]));
    }
  }
  printf("%s: %zu vertices, coefficients differ by %.1e of the largest\n", names[0], n,
         worst / largest);
  assert_true(worst <= 1e-5 * largest);
  supine_safetensors_close(file);
  direct_solver_free(&direct);
  full_operator_free(&op);
  supine_sh_grid_destroy(grid);
  supine_lungs_free(&lungs);
  free(projected);
  free(force);
  free(ones);
}

TEST(test_precompute_real_adult_coefficients_equal_direct_solution) {
  static const char *const names[] = {"left.obj", "right.obj"};
  check_coefficients(names, SUPINE_AXES_AUTO);
}

TEST_FULL(test_precompute_real_ras_lungs_coefficients_equal_direct_solution) {
  static const char *const names[] = {"covid/covid001_left.ply", "covid/covid001_right.ply"};
  check_coefficients(names, SUPINE_AXES_RAS);
}

/* A mean over directions of gravity, and its standard error. */
typedef struct sample_mean {
  double mean, error;
} sample_mean;

static sample_mean mean_of(size_t count, const double *values) {
  double sum = 0.0;
  double square = 0.0;
  for (size_t i = 0; i < count; ++i) {
    sum += values[i];
    square += values[i] * values[i];
  }
  const double mean = sum / (double)count;
  return (sample_mean){mean, sqrt((square / (double)count - mean * mean) / (double)(count - 1))};
}

enum { CHECKED = 600 };

/* Compare the displacements of a basis with those of supine_physics_solve, in `count` directions of
 * gravity. For each direction, set three means over the vertices, mm^2:
 * - error2: squared difference of the displacements
 * - field2: squared displacement
 * - error_mm2: squared difference after scaling both displacements to `volume`, mL */
static void true_errors(const supine_lungs *lungs, const supine_model *model,
                        const supine_basis *basis, size_t count, const double *directions,
                        double volume, double *error2, double *field2, double *error_mm2) {
  const size_t n = lungs->mesh.vertex_count;
  float *deformed = malloc(3 * n * sizeof *deformed);
  double *solved = malloc(3 * n * sizeof *solved);
  for (size_t d = 0; d < count; ++d) {
    const double *g = directions + 3 * d;
    double weights[SUPINE_MODES_MAX];
    double scales[2] = {1.0, 1.0};
    double scale;
    supine_solution solution = {0};
    assert_int_equal(supine_physics_solve(lungs, model, g, &solution, NULL), SUPINE_OK);
    assert_int_equal(supine_basis_weights(basis, g, weights), SUPINE_OK);
    supine_physics_solution_apply(&solution, &lungs->mesh, 1.0, solved);
    supine_deform(basis, POSED(basis, weights, scales), deformed);
    error2[d] = field2[d] = error_mm2[d] = 0.0;
    for (size_t i = 0; i < 3 * n; ++i) {
      error2[d] += pow((double)deformed[i] - solved[i], 2.0) / (double)n;
      field2[d] += pow(solved[i] - lungs->mesh.vertices[i], 2.0) / (double)n;
    }
    assert_int_equal(supine_volume_scale(solution.cubic, volume, &scale, NULL), SUPINE_OK);
    assert_int_equal(posed_scale(basis, weights, volume, scales, NULL), SUPINE_OK);
    scales[1] = scales[0];
    supine_physics_solution_apply(&solution, &lungs->mesh, scale, solved);
    supine_deform(basis, POSED(basis, weights, scales), deformed);
    for (size_t i = 0; i < 3 * n; ++i) {
      error_mm2[d] += pow((double)deformed[i] - solved[i], 2.0) / (double)n;
    }
    supine_physics_solution_free(&solution);
  }
  free(deformed);
  free(solved);
}

/* Return the relative RMS error of a basis that is cut to its first `kept` modes. */
static double error_of_first(size_t kept, const supine_lungs *lungs, const supine_model *model,
                             const supine_basis *basis, size_t count, const double *directions) {
  const size_t n = lungs->mesh.vertex_count;
  const double scales[2] = {1.0, 1.0};
  float *deformed = malloc(3 * n * sizeof *deformed);
  double *solved = malloc(3 * n * sizeof *solved);
  double error2 = 0.0;
  double field2 = 0.0;
  for (size_t d = 0; d < count; ++d) {
    double weights[SUPINE_MODES_MAX];
    supine_solution solution = {0};
    assert_int_equal(supine_physics_solve(lungs, model, directions + 3 * d, &solution, NULL),
                     SUPINE_OK);
    assert_int_equal(supine_basis_weights(basis, directions + 3 * d, weights), SUPINE_OK);
    memset(weights + kept, 0, (SUPINE_MODES_MAX - kept) * sizeof *weights);
    supine_physics_solution_apply(&solution, &lungs->mesh, 1.0, solved);
    supine_deform(basis, POSED(basis, weights, scales), deformed);
    for (size_t i = 0; i < 3 * n; ++i) {
      error2 += pow((double)deformed[i] - solved[i], 2.0);
      field2 += pow(solved[i] - lungs->mesh.vertices[i], 2.0);
    }
    supine_physics_solution_free(&solution);
  }
  free(deformed);
  free(solved);
  return sqrt(error2 / field2);
}

/* Check the tables in the file: `error_modes` holds the errors measured if only the first modes are
 * kept, and `error_harmonics` decreases as bands of harmonics are added. */
static void check_error_table(const supine_lungs *lungs, const supine_model *model,
                              const supine_basis *basis, size_t count, const double *directions) {
  const supine_tensor *by_modes = supine_basis_tensor(basis, "error_modes");
  const supine_tensor *by_band = supine_basis_tensor(basis, "error_harmonics");
  const size_t modes = supine_basis_get_info(basis)->mode_count;
  const double *stated = by_modes->data;
  assert_int_equal(by_modes->shape[0], modes);
  for (size_t kept = 1; kept <= modes; kept += (modes - 1) / 2) {
    const double measured = error_of_first(kept, lungs, model, basis, count, directions);
    assert_close(stated[kept - 1], measured, (model->force.soften == 0.0 ? 1e-4 : 1e-3) * measured);
  }
  const double *bands = by_band->data;
  for (size_t l = 0; l < by_band->shape[0]; ++l) {
    assert_true(l == 0 || bands[l] <= (1.0 + 1e-12) * bands[l - 1]);
    if (modes == by_band->shape[0] * by_band->shape[0]) { /* if the modes are the harmonics */
      assert_close(bands[l], stated[(l + 1) * (l + 1) - 1], 1e-4 * bands[l]);
    }
  }
}

/* Check that the basis file states the error measured in held-out directions of gravity. If
 * `soften` > 0 (lower tissue is softer), superposed solves add an error, so the tolerance is
 * larger. */
static void check_stated_error(const supine_lungs *lungs, size_t band, size_t modes,
                               double soften) {
  enum { HELD_OUT = 40 };
  const supine_basis_report report = make_basis(lungs, band, modes, soften, HELD_OUT);
  supine_basis *basis = open_basis();
  supine_model model = supine_physics_model(SUPINE_LAW_PAPER);
  double g[3 * HELD_OUT];
  double error2[HELD_OUT];
  double field2[HELD_OUT];
  double error_mm2[HELD_OUT];
  model.force.soften = soften;
  model.reach = soften != 0.0 ? 10.0 : 0.0;
  supine_projection_held_out_directions(HELD_OUT, g);
  true_errors(lungs, &model, basis, HELD_OUT, g, report.accuracy.volume, error2, field2, error_mm2);
  const double relative = sqrt(mean_of(HELD_OUT, error2).mean / mean_of(HELD_OUT, field2).mean);
  const double rounding = soften == 0.0 ? 1e-4 : 1e-3;
  assert_close(report.accuracy.relative_rms, relative, rounding * relative);
  assert_close(report.accuracy.rms_mm, sqrt(mean_of(HELD_OUT, error_mm2).mean),
               1e-3 * report.accuracy.rms_mm);
  assert_true(report.accuracy.relative_p95 > report.accuracy.relative_rms);
  assert_true(report.accuracy.relative_max > report.accuracy.relative_p95);
  assert_true(report.accuracy.max_mm > report.accuracy.p95_mm);
  assert_close(strtod(supine_basis_metadata(basis, "error_rms_percent"), NULL), 100.0 * relative,
               1e-3 * 100.0 * relative);
  if (lungs->mesh.vertex_count <= 4096) {
    check_error_table(lungs, &model, basis, HELD_OUT, g);
  }
  supine_basis_close(basis);
}

/* Check that the displacement error stated in the basis file equals that measured in random
 * directions of gravity, within four standard errors of the measurement. */
static void check_error_elsewhere(const supine_lungs *lungs, size_t band, size_t modes,
                                  double soften, const char *what) {
  const supine_basis_report report = make_basis(lungs, band, modes, soften, 0);
  const supine_accuracy *stated = &report.accuracy;
  supine_basis *basis = open_basis();
  supine_model model = supine_physics_model(SUPINE_LAW_PAPER);
  double g[3 * CHECKED];
  double error2[CHECKED];
  double field2[CHECKED];
  double error_mm2[CHECKED];
  uint64_t seed = 2026;
  for (size_t d = 0; d < CHECKED; ++d) {
    random_direction(&seed, g + 3 * d);
  }
  model.force.soften = soften;
  model.reach = soften != 0.0 ? 10.0 : 0.0;
  true_errors(lungs, &model, basis, CHECKED, g, stated->volume, error2, field2, error_mm2);
  const sample_mean error = mean_of(CHECKED, error2);
  const sample_mean field = mean_of(CHECKED, field2);
  printf("%s, soften %g: stated error %.3f %%, %.4f mm; found %.3f %%, %.4f mm\n", what, soften,
         100.0 * stated->relative_rms, stated->rms_mm, 100.0 * sqrt(error.mean / field.mean),
         sqrt(mean_of(CHECKED, error_mm2).mean));
  assert_true(error.error < 0.2 * error.mean); /* the sample is large enough */
  assert_close(stated->relative_rms * stated->relative_rms, error.mean / field.mean,
               4.0 * error.error / field.mean);
  supine_basis_close(basis);
}

TEST(test_precompute_held_out_directions_error_as_stated) {
  supine_lungs lungs = phantom(2000);
  check_stated_error(&lungs, 3, 0, 0.0);
  check_stated_error(&lungs, 15, 16, 0.0);
  check_stated_error(&lungs, 5, 9, 1.0);
  supine_lungs_free(&lungs);
}

TEST(test_precompute_random_directions_error_as_stated) {
  supine_lungs lungs = phantom(1500);
  check_error_elsewhere(&lungs, 3, 0, 0.0, "phantom, 16 harmonics");
  check_error_elsewhere(&lungs, 15, 16, 0.0, "phantom, best modes of band 15");
  check_error_elsewhere(&lungs, 7, 16, 1.0, "phantom, best modes of band 7");
  supine_lungs_free(&lungs);
}

/* Check that the relative error with the leading modes is at most `most`. With 16 spherical
 * harmonics, as in [Santhanam2008], it must be at least `least_ratio` times as large. */
static void check_best_modes(const char *name, supine_axes axes, double soften, double most,
                             double least_ratio) {
  supine_lungs lungs = {0};
  if (!helper_real_lungs(&name, 1, axes, &lungs)) {
    skip();
    return;
  }
  const supine_basis_report harmonics = make_basis(&lungs, 3, 0, soften, 0);
  const supine_basis_report modes = make_basis(&lungs, 23, 16, soften, 0);
  const double error = modes.accuracy.relative_rms;
  printf("%s, soften %g: error with harmonics %.2f %%, with %zu modes %.3f %%\n", name, soften,
         100.0 * harmonics.accuracy.relative_rms, modes.mode_count, 100.0 * error);
  assert_true(modes.mode_count <= (soften == 0.0 ? 4 : 16));
  assert_true(error <= most);
  assert_true(harmonics.accuracy.relative_rms >= least_ratio * error);
  supine_lungs_free(&lungs);
}

TEST(test_precompute_real_lung_error_within_0_6_percent) {
  check_best_modes("left.obj", SUPINE_AXES_AUTO, 0.0, 0.005, 8.0);
  check_best_modes("left.obj", SUPINE_AXES_AUTO, 1.0, 0.006, 8.0);
}

TEST_FULL(test_precompute_other_real_lung_error_within_0_6_percent) {
  check_best_modes("covid/covid002_right.ply", SUPINE_AXES_RAS, 0.0, 0.005, 8.0);
  check_best_modes("covid/covid002_right.ply", SUPINE_AXES_RAS, 1.0, 0.006, 8.0);
}

/* Return the volume that the deformed surface gains beyond the reference surface, mL. */
static double measured_volume(const supine_basis *basis, const double *weights,
                              const double *scales) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  supine_mesh mesh = {.vertex_count = info->vertex_count, .triangle_count = info->triangle_count};
  float *xyz = malloc(3 * mesh.vertex_count * sizeof *xyz);
  double *vertices = malloc(3 * mesh.vertex_count * sizeof *vertices);
  uint32_t *triangles = malloc(3 * mesh.triangle_count * sizeof *triangles);
  memcpy(triangles, supine_basis_triangles(basis), 3 * mesh.triangle_count * sizeof *triangles);
  mesh.vertices = vertices;
  mesh.triangles = triangles;
  supine_deform(basis, POSED(basis, weights, scales), xyz);
  double volume = 0.0;
  for (int rest = 0; rest < 2; ++rest) {
    const float *from = rest ? supine_basis_vertices(basis) : xyz;
    for (size_t i = 0; i < 3 * mesh.vertex_count; ++i) {
      vertices[i] = (double)from[i];
    }
    volume += (rest ? -1e-3 : 1e-3) * supine_mesh_volume(&mesh);
  }
  free(xyz);
  free(vertices);
  free(triangles);
  return volume;
}

static void check_volumes(const supine_lungs *lungs, size_t band, size_t modes, double soften,
                          double least) {
  static const double postures[6][3] = {{0, 1, 0},  {0, -1, 0}, {1, 0, 0},
                                        {-1, 0, 0}, {0, 0, -1}, {0, 0, 1}};
  (void)make_basis(lungs, band, modes, soften, 0);
  supine_basis *basis = open_basis();
  uint64_t seed = 400;
  double worst = 0.0;
  for (size_t d = 0; d < 106; ++d) {
    double g[3];
    double weights[SUPINE_MODES_MAX];
    double scales[2];
    if (d < 6) {
      memcpy(g, postures[d], sizeof g);
    } else {
      random_direction(&seed, g);
    }
    assert_int_equal(supine_basis_weights(basis, g, weights), SUPINE_OK);
    for (int out = 0; out < 2; ++out) {
      const double volume = out ? least : 500.0;
      assert_int_equal(posed_scale(basis, weights, volume, scales, NULL), SUPINE_OK);
      scales[1] = scales[0];
      worst = fmax(worst, fabs(measured_volume(basis, weights, scales) - volume));
    }
  }
  printf("volumes off by at most %.4f mL\n", worst);
  assert_true(worst <= 0.05);
  supine_basis_close(basis);
}

TEST(test_precompute_volumes_exact_in_every_direction) {
  supine_lungs lungs = phantom(3000);
  check_volumes(&lungs, 3, 0, 0.0, -300.0);
  /* Head down, the phantom with softer lower tissue folds at -299 mL: test to -200 mL only. */
  check_volumes(&lungs, 7, 10, 1.0, -200.0);
  supine_lungs_free(&lungs);
}

TEST(test_precompute_real_lungs_volumes_exact_in_every_direction) {
  supine_lungs lungs = real_pair();
  check_volumes(&lungs, 15, 16, 0.0, -300.0);
  supine_lungs_free(&lungs);
}

TEST(test_precompute_paper_law_keeps_four_modes) {
  supine_lungs lungs = phantom(1000);
  const supine_basis_report report = make_basis(&lungs, 15, 16, 0.0, 0);
  assert_int_equal(report.mode_count, 4);
  supine_lungs_free(&lungs);
}

static void normal_of(const float *xyz, const uint32_t *corner, double *normal) {
  double u[2][3];
  for (size_t j = 0; j < 2; ++j) {
    for (size_t i = 0; i < 3; ++i) {
      u[j][i] = (double)xyz[3 * (size_t)corner[j + 1] + i] - (double)xyz[3 * (size_t)corner[0] + i];
    }
  }
  normal[0] = u[0][1] * u[1][2] - u[0][2] * u[1][1];
  normal[1] = u[0][2] * u[1][0] - u[0][0] * u[1][2];
  normal[2] = u[0][0] * u[1][1] - u[0][1] * u[1][0];
}

/* Return the share of triangles that are reversed when the library deforms the lungs to `volume`
 * mL: the largest share of six postures. */
static double turned_over_at_run_time(double volume) {
  supine_basis *basis = open_basis();
  const supine_basis_info *info = supine_basis_get_info(basis);
  const float *rest = supine_basis_vertices(basis);
  const uint32_t *triangles = supine_basis_triangles(basis);
  float *xyz = malloc(3 * info->vertex_count * sizeof *xyz);
  double worst = 0.0;
  for (int g = 0; g < 6; ++g) {
    double gravity[3] = {0.0, 0.0, 0.0};
    double weights[SUPINE_MODES_MAX];
    double scale;
    gravity[g % 3] = g < 3 ? 1.0 : -1.0;
    assert_int_equal(supine_basis_weights(basis, gravity, weights), SUPINE_OK);
    if (posed_scale(basis, weights, volume, &scale, NULL) != SUPINE_OK) {
      continue;
    }
    const double scales[SUPINE_LUNGS_MAX] = {scale, scale};
    supine_deform(basis, POSED(basis, weights, scales), xyz);
    size_t turned = 0;
    for (size_t t = 0; t < info->triangle_count; ++t) {
      double before[3];
      double after[3];
      normal_of(rest, triangles + 3 * t, before);
      normal_of(xyz, triangles + 3 * t, after);
      turned += before[0] * after[0] + before[1] * after[1] + before[2] * after[2] < 0.0;
    }
    worst = fmax(worst, (double)turned / (double)info->triangle_count);
  }
  free(xyz);
  supine_basis_close(basis);
  return worst;
}

/* Return a copy of the triangles of lungs, repeated until there are more than 50,000, of which
 * every second one has no area. Only the others are measured in a mesh of this size. */
static supine_lungs with_more_triangles(const supine_lungs *lungs) {
  supine_lungs dense = *lungs;
  const size_t count = lungs->mesh.triangle_count;
  const size_t times = 26000 / count + 1;
  dense.mesh.triangle_count = 2 * times * count;
  dense.mesh.triangles = calloc(3 * dense.mesh.triangle_count, sizeof(uint32_t));
  for (size_t t = 0; t < times * count; ++t) {
    memcpy(dense.mesh.triangles + 6 * t, lungs->mesh.triangles + 3 * (t % count),
           3 * sizeof(uint32_t));
  }
  return dense;
}

/* If lungs empty in one posture only, more triangles are reversed than if the lungs lose the same
 * mean volume in all postures. */
TEST(test_turned_over_one_posture_emptied_finds_more_reversed) {
  supine_lungs lungs = phantom(1500);
  const size_t n = lungs.mesh.vertex_count;
  const supine_model model = supine_physics_model(SUPINE_LAW_PAPER);
  const double full = 1e-3 * supine_mesh_volume(&lungs.mesh);
  double *directions = malloc(3 * n * sizeof *directions);
  const supine_rows rows = {SUPINE_ROWS_SCALAR, directions};
  supine_projection projection;
  supine_compression field;
  supine_volume_forms forms = {0};
  assert_int_equal(
      supine_physics_directions(&lungs, &model.force, &model.direction, directions, NULL),
      SUPINE_OK);
  assert_int_equal(supine_projection_create(&lungs, &model, 3, &projection, NULL), SUPINE_OK);
  assert_int_equal(supine_sh_compress_harmonics(&projection.expansion, &field, NULL), SUPINE_OK);
  assert_int_equal(supine_projection_volume_forms(&field, &lungs, model.share, &rows, &forms, NULL),
                   SUPINE_OK);
  static const int postures[] = {0, 1, 3};
  for (size_t p = 0; p < sizeof postures / sizeof *postures; ++p) {
    const int g = postures[p];
    static const size_t term[3] = {3, 1, 2}; /* index of the band-1 harmonic along x, y, z */
    const double part = -0.72 * full;
    const double sign = g < 3 ? 1.0 : -1.0;
    /* Expand the volume at rest in harmonics: `part` mL in one posture, 0 mL in the opposite one.
     * The divisors are the values of the harmonics of degrees 0 and 1 along that axis. */
    double resting[9] = {0.5 * part / 0.28209479177387814};
    resting[term[g % 3]] = sign * 0.5 * part / 0.48860251190291992;
    const double even[9] = {resting[0]};
    double share = 0.0;
    double least = 0.0;
    assert_int_equal(
        supine_projection_turned_over(&lungs, &rows, &field, &forms, resting, &share, NULL),
        SUPINE_OK);
    assert_int_equal(
        supine_projection_turned_over(&lungs, &rows, &field, &forms, even, &least, NULL),
        SUPINE_OK);
    supine_lungs dense = with_more_triangles(&lungs);
    double sampled = 0.0;
    assert_int_equal(
        supine_projection_turned_over(&dense, &rows, &field, &forms, resting, &sampled, NULL),
        SUPINE_OK);
    free(dense.mesh.triangles);
    assert_close(sampled, share, 1e-12);
    assert_true(share > least + 0.02); /* 0.12 to 0.15 of the triangles turn, against 0.08 */
  }
  supine_physics_volume_forms_free(&forms);
  supine_sh_compression_free(&field);
  supine_projection_free(&projection);
  free(directions);
  supine_lungs_free(&lungs);
}

TEST(test_precompute_turned_over_share_equals_run_time) {
  supine_lungs lungs = phantom(3000);
  supine_prepared prepared = {.source = {.lungs = lungs},
                              .model = supine_physics_model(SUPINE_LAW_PAPER)};
  const supine_basis_choice choice = {.band = 7, .modes = 4, .held_out = 20};
  double *stiffness = malloc(lungs.mesh.vertex_count * sizeof *stiffness);
  uint64_t seed = 3;
  for (size_t i = 0; i < lungs.mesh.vertex_count; ++i) {
    stiffness[i] = exp(8.0 * helper_random(&seed));
  }
  supine_basis_report report;
  assert_int_equal(helper_write_basis(path, &prepared, &choice, &report, NULL), SUPINE_OK);
  assert_true(report.turned_over < 0.001);
  assert_close(report.turned_over, turned_over_at_run_time(report.accuracy.volume), 1e-4);
  prepared.model.stiffness = stiffness; /* irregular stiffness reverses triangles */
  assert_int_equal(helper_write_basis(path, &prepared, &choice, &report, NULL), SUPINE_OK);
  assert_true(report.turned_over > 0.01);
  assert_close(report.turned_over, turned_over_at_run_time(report.accuracy.volume), 1e-3);
  free(stiffness);
  supine_lungs_free(&lungs);
}

TEST(test_precompute_real_lungs_with_reach_few_reversed) {
  supine_lungs lungs = real_pair();
  const supine_basis_report links = make_basis(&lungs, 7, 4, 0.0, 20);
  reach = 10.0;
  const supine_basis_report length = make_basis(&lungs, 7, 4, 0.0, 20);
  reach = 0.0;
  printf("reversed triangles at %g mL: %.2f %%; with a reach of 10 mm %.4f %%\n",
         links.accuracy.volume, 100.0 * links.turned_over, 100.0 * length.turned_over);
  assert_true(links.turned_over > 0.01);
  assert_true(length.turned_over < 1e-4);
  supine_lungs_free(&lungs);
}

TEST(test_precompute_bad_options_refused) {
  supine_lungs lungs = phantom(500);
  supine_prepared prepared = {.source = {.lungs = lungs},
                              .model = supine_physics_model(SUPINE_LAW_PAPER)};
  supine_basis_choice choice = {.band = 65, .modes = 16};
  supine_error error;
  assert_int_equal(helper_write_basis(path, &prepared, &choice, NULL, &error),
                   SUPINE_ERROR_ARGUMENT);
  choice.band = 8;
  choice.modes = 0; /* all 81 harmonics: too many */
  assert_int_equal(helper_write_basis(path, &prepared, &choice, NULL, &error),
                   SUPINE_ERROR_ARGUMENT);
  choice.modes = 65;
  assert_int_equal(helper_write_basis(path, &prepared, &choice, NULL, &error),
                   SUPINE_ERROR_ARGUMENT);
  choice.modes = 16;
  /* Softening of lower tissue (`soften`) requires a smoothing distance of forces (`reach`) > 0. */
  prepared.model.force.soften = 1.0;
  assert_int_equal(helper_write_basis(path, &prepared, &choice, NULL, &error),
                   SUPINE_ERROR_ARGUMENT);
  supine_lungs_free(&lungs);
}

TEST_GROUP(setup, teardown)
