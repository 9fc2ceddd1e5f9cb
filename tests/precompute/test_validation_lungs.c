/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test statements of [Santhanam2008] III-C and IV-B on real lungs: displacement by volume,
 * ventilation by height, and the effect of mesh resolution. */
#include "tests/helpers/test.h"

#include <supine/runtime.h>

#include "tests/helpers/basis_helpers.h"
#include "tests/helpers/lungs_helpers.h"
#include "tests/helpers/validation.h"

#include "tests/helpers/poses.h"

static const double postures[4][3] = {{0, 1, 0}, {0, -1, 0}, {1, 0, 0}, {-1, 0, 0}};
static const char *const posture_names[] = {"supine", "prone", "left", "right"};

static bool load(const char *left, const char *right, supine_lungs *lungs) {
  const char *const names[] = {left, right};
  return helper_real_lungs(names, 2, SUPINE_AXES_AUTO, lungs);
}

/* In one orientation every vertex moves along a line, nearly in proportion to the volume
 * ([Santhanam2008] III-C). The run-time library deforms the lungs from a basis file. */
TEST(test_deform_one_orientation_linear_in_volume) {
  char path[] = "/tmp/supine-validation-XXXXXX";
  supine_lungs lungs = {0};
  if (!load("left.obj", "right.obj", &lungs)) {
    skip();
  }
  const int file = mkstemp(path);
  assert_true(file >= 0);
  (void)close(file);
  const supine_prepared prepared = {.source = {.lungs = lungs},
                                    .model = supine_physics_model(SUPINE_LAW_PAPER)};
  const supine_basis_choice choice = {.band = 7, .modes = 16, .held_out = 5};
  assert_int_equal(helper_write_basis(path, &prepared, &choice, NULL, NULL), SUPINE_OK);
  supine_basis *basis = NULL;
  assert_int_equal(supine_basis_open(path, &basis, NULL), SUPINE_OK);
  const size_t n = supine_basis_get_info(basis)->vertex_count;
  float *full = calloc(3 * n, sizeof *full);
  float *part = calloc(3 * n, sizeof *part);
  const float *rest = supine_basis_vertices(basis);
  for (size_t p = 0; p < 4; ++p) {
    double weights[SUPINE_MODES_MAX];
    double scales[2];
    assert_int_equal(supine_basis_weights(basis, postures[p], weights), SUPINE_OK);
    assert_int_equal(posed_scale(basis, weights, 500.0, &scales[0], NULL), SUPINE_OK);
    scales[1] = scales[0];
    supine_deform(basis, POSED(basis, weights, scales), full);
    double bend = 0.0;
    double turn = 0.0;
    for (int step = 1; step < 10; ++step) {
      double at[2];
      assert_int_equal(posed_scale(basis, weights, 50.0 * step, &at[0], NULL), SUPINE_OK);
      at[1] = at[0];
      supine_deform(basis, POSED(basis, weights, at), part);
      bend = fmax(bend, fabs(at[0] / scales[0] - 0.1 * step));
      for (size_t i = 0; i < n; ++i) {
        double dot = 0.0;
        double square[2] = {0.0, 0.0};
        for (size_t k = 0; k < 3; ++k) {
          const double a = (double)full[3 * i + k] - (double)rest[3 * i + k];
          const double b = (double)part[3 * i + k] - (double)rest[3 * i + k];
          dot += a * b;
          square[0] += a * a;
          square[1] += b * b;
        }
        if (square[1] > 0.25) { /* at least 0.5 mm, to define a direction in single precision */
          turn = fmax(turn, 1.0 - dot / sqrt(square[0] * square[1]));
        }
      }
    }
    printf("%s: up to 500 mL, displacements deviate from proportionality to the volume by at most "
           "%.2f %%, and from one line by %.1e (1 - cosine)\n",
           posture_names[p], 100.0 * bend, turn);
    assert_true(bend < 0.02);
    assert_true(turn < 1e-6);
  }
  supine_basis_close(basis);
  supine_lungs_free(&lungs);
  (void)unlink(path);
  free(full);
  free(part);
}

/* Supine, prone and on either side, ventilation increases from the uppermost to the lowermost zone
 * with about the same gradient, as Kaneko et al. found (J. Appl. Physiol. 21, 1966, 767-777). */
TEST(test_solve_all_postures_dependent_zones_ventilate_more) {
  supine_lungs lungs = {0};
  if (!load("left.obj", "right.obj", &lungs)) {
    skip();
  }
  double least = INFINITY;
  double most = 0.0;
  for (size_t p = 0; p < 4; ++p) {
    ventilation found = {0};
    assert_int_equal(ventilation_measure(&lungs, postures[p], 500.0, &found), SUPINE_OK);
    printf("%-6s ventilation index from uppermost to lowermost:", posture_names[p]);
    for (size_t z = 0; z < ZONES; ++z) {
      printf(" %.2f", found.index[z]);
      assert_true(z == 0 || found.index[z] > found.index[z - 1]);
    }
    printf("; slope %.2f over the height, %.3f per cm\n       swept volume:", found.slope,
           10.0 * found.slope / found.height);
    for (size_t z = 0; z < ZONES; ++z) {
      printf(" %.2f", found.swept[z]);
    }
    printf("\n");
    least = fmin(least, found.slope);
    most = fmax(most, found.slope);
  }
  assert_true(most < 1.25 * least);
  supine_lungs_free(&lungs);
}

/* The same lungs with 5,000 and with 20,000 vertices move differently. If forces are spread over a
 * fixed distance (`reach`, mm), the difference is less than half as large. */
TEST_FULL(test_solve_reach_reduces_change_with_resolution) {
  supine_lungs coarse = {0};
  supine_lungs fine = {0};
  if (!load("lungs/chaste_left_5k.obj", "lungs/chaste_right_5k.obj", &coarse) ||
      !load("lungs/chaste_left.ply", "lungs/chaste_right.ply", &fine)) {
    supine_lungs_free(&coarse);
    skip();
  }
  double *moves[2] = {calloc(3 * coarse.mesh.vertex_count + 1, sizeof(double)),
                      calloc(3 * fine.mesh.vertex_count + 1, sizeof(double))};
  double drift[2];
  double spread[2][2] = {{0.0}};
  nearest_grid grid = nearest_create(&fine.mesh, 5.0);
  const size_t vertex = coarse.mesh.vertex_count / 3;
  const size_t same = nearest_find(&grid, coarse.mesh.vertices + 3 * vertex);
  assert_true(same != SIZE_MAX);
  for (int with = 0; with < 2; ++with) {
    const double reach = with == 1 ? 10.0 : 0.0;
    assert_int_equal(breathe_at(&coarse, reach, postures[0], 500.0, moves[0]), SUPINE_OK);
    assert_int_equal(breathe_at(&fine, reach, postures[0], 500.0, moves[1]), SUPINE_OK);
    drift[with] = drift_of(&coarse.mesh, moves[0], &fine.mesh, moves[1]);
    assert_int_equal(spread_of(&coarse, reach, vertex, &spread[with][0]), SUPINE_OK);
    assert_int_equal(spread_of(&fine, reach, same, &spread[with][1]), SUPINE_OK);
    printf("reach %2.0f mm, 5,000 to 20,000 vertices: displacements change by %.2f %% RMS; a unit "
           "force spreads %.2f, then %.2f mm\n",
           reach, 100.0 * drift[with], spread[with][0], spread[with][1]);
  }
  assert_true(drift[1] < 0.5 * drift[0]);
  assert_true(fabs(spread[1][1] / spread[1][0] - 1.0) < 0.03);
  assert_true(fabs(spread[0][1] / spread[0][0] - 1.0) > 0.1);
  nearest_free(&grid);
  supine_lungs_free(&coarse);
  supine_lungs_free(&fine);
  free(moves[0]);
  free(moves[1]);
}
