/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Full inflation as the reference: found from scans in any state, and rest by posture. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include <supine/runtime.h>
#include <supine/sh.h>
#include <supine/volume.h>

#include "precompute/lungs/phantom.h"
#include "precompute/physics/solve.h"
#include "precompute/precompute.h"

#include "lungs_helpers.h"

#include "tests/poses.h"

static const double promised = 0.005; /* mm, of a scan's reproduction */

static char path[] = "/tmp/supine-reference-XXXXXX";

static supine_lungs made_lungs(void) {
  supine_mesh mesh = {0};
  supine_lungs lungs = {0};
  assert_int_equal(supine_phantom_create(1200, 6000.0, &mesh, NULL), SUPINE_OK);
  assert_int_equal(supine_lungs_create(&mesh, 1, NULL, &lungs, NULL), SUPINE_OK);
  supine_mesh_free(&mesh);
  return lungs;
}

/* The same lungs `volume` mL below full, in a posture: a scan of them. */
static supine_lungs scan_of(const supine_lungs *full, const supine_model *model, const double g[3],
                            double volume) {
  supine_solution solution = {0};
  supine_mesh moved = full->mesh;
  supine_lungs scan = {0};
  double scale = 0.0;
  assert_int_equal(supine_physics_solve(full, model, g, &solution, NULL), SUPINE_OK);
  assert_int_equal(supine_volume_scale(solution.cubic, volume, &scale, NULL), SUPINE_OK);
  moved.vertices = malloc(3 * moved.vertex_count * sizeof(double));
  supine_physics_solution_apply(&solution, &full->mesh, scale, moved.vertices);
  assert_int_equal(supine_lungs_create(&moved, 1, &full->midline, &scan, NULL), SUPINE_OK);
  free(moved.vertices);
  supine_physics_solution_free(&solution);
  return scan;
}

static double farthest(const double *a, const double *b, size_t count) {
  double most = 0.0;
  for (size_t i = 0; i < 3 * count; i += 3) {
    most = fmax(most, hypot(hypot(a[i] - b[i], a[i + 1] - b[i + 1]), a[i + 2] - b[i + 2]));
  }
  return most;
}

static void test_axes_values_met_and_harmonics_agree_everywhere(void **state) {
  (void)state;
  static const double values[6] = {-3.1, 2.7, 0.4, -1.9, 5.3, 0.08};
  double harmonics[9];
  uint64_t seed = 77;
  supine_reference_harmonics(values, harmonics);
  for (size_t axis = 0; axis < 6; ++axis) {
    double g[3] = {0.0, 0.0, 0.0};
    g[axis / 2] = axis % 2 == 0 ? 1.0 : -1.0;
    assert_true(fabs(supine_reference_along_axes(values, g) - values[axis]) < 1e-15 * 16.0);
  }
  for (int trial = 0; trial < 50; ++trial) {
    double g[3] = {helper_random(&seed) - 0.5, helper_random(&seed) - 0.5,
                   helper_random(&seed) - 0.5};
    const double size = sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2]);
    double y[9];
    double sum = 0.0;
    for (size_t k = 0; k < 3; ++k) {
      g[k] /= size;
    }
    assert_int_equal(supine_sh_evaluate(2, g, y), SUPINE_OK);
    for (size_t t = 0; t < 9; ++t) {
      sum += harmonics[t] * y[t];
    }
    assert_true(fabs(sum - supine_reference_along_axes(values, g)) < 1e-14 * 16.0);
  }
}

static void test_resting_defaults_and_options(void **state) {
  (void)state;
  static const double wanted[6] = {0.47, 0.47, 0.43, 0.47, 0.43, 0.53};
  supine_resting resting = supine_reference_resting_default();
  supine_error error = {0};
  assert_memory_equal(resting.share, wanted, sizeof wanted);
  assert_int_equal(supine_reference_resting_set(&resting, "HFP", 0.5, &error), SUPINE_OK);
  assert_true(resting.share[3] == 0.5 && resting.share[2] == 0.43);
  assert_int_equal(supine_reference_resting_set(&resting, "pron", 0.5, &error),
                   SUPINE_ERROR_ARGUMENT);
  assert_non_null(strstr(error.message, "prone"));
  static const double bad[] = {0.1, 0.0, -0.4, 1.01, NAN};
  for (size_t i = 0; i < sizeof bad / sizeof *bad; ++i) {
    assert_int_equal(supine_reference_resting_set(&resting, "left", bad[i], &error),
                     SUPINE_ERROR_ARGUMENT);
  }
  FILE *file = fopen(path, "wb");
  assert_non_null(file);
  (void)fputs("posture,share\nupright,0.6\n# a note\nright,0.44\n", file);
  assert_int_equal(fclose(file), 0);
  assert_int_equal(supine_reference_resting_load(path, &resting, &error), SUPINE_OK);
  assert_true(resting.share[5] == 0.6 && resting.share[1] == 0.44 && resting.share[0] == 0.47);
  file = fopen(path, "wb");
  assert_non_null(file);
  (void)fputs("posture,share\nupright,0.6\nright,7\n", file);
  assert_int_equal(fclose(file), 0);
  assert_int_equal(supine_reference_resting_load(path, &resting, &error), SUPINE_ERROR_ARGUMENT);
  assert_non_null(strstr(error.message, "line 3"));
}

/* In the posture that it was fitted in the split of the gradient changes nothing. */
static void test_deep_law_supine_is_its_unsplit_form(void **state) {
  (void)state;
  static const double supine[3] = {0.0, 1.0, 0.0};
  supine_lungs lungs = made_lungs();
  const supine_model split = supine_physics_model(SUPINE_LAW_DEEP);
  supine_model whole = split;
  whole.force = (supine_force_law){.base = 0.7, .gain = 0.6};
  double scale[2];
  supine_solution solution[2];
  assert_int_equal(supine_physics_solve(&lungs, &split, supine, &solution[0], NULL), SUPINE_OK);
  assert_int_equal(supine_physics_solve(&lungs, &whole, supine, &solution[1], NULL), SUPINE_OK);
  for (int k = 0; k < 2; ++k) {
    assert_int_equal(supine_volume_scale(solution[k].cubic, 500.0, &scale[k], NULL), SUPINE_OK);
  }
  for (size_t i = 0; i < lungs.mesh.vertex_count; ++i) {
    const double a = scale[0] * solution[0].catch_[i];
    const double b = scale[1] * solution[1].catch_[i];
    assert_true(fabs(a - b) < 1e-10 * fabs(b));
  }
  supine_physics_solution_free(&solution[0]);
  supine_physics_solution_free(&solution[1]);
  supine_lungs_free(&lungs);
}

static void test_laws_constants_are_as_tabled(void **state) {
  (void)state;
  static const struct {
    const char *name;
    double base, gain, box[3], c[6], reach;
    bool pair;
  } table[SUPINE_LAW_COUNT] = {
      {"deep", 0.9, 0.4, {0, -0.2, 0}, {6, 2.6, 15, 1, 16, 1.3}, 10.0, true},
      {"paper", 0.0, 1.0, {0, 0, 0}, {2, 1.5, 1.5, 1, 16, 1.4}, 0.0, false}};
  for (int law = 0; law < SUPINE_LAW_COUNT; ++law) {
    const supine_model model = supine_physics_model((supine_law)law);
    assert_string_equal(supine_physics_law_names[law], table[law].name);
    assert_true(model.law == (supine_law)law && model.force.base == table[law].base);
    assert_true(model.force.gain == table[law].gain && model.reach == table[law].reach);
    assert_memory_equal(model.force.box, table[law].box, sizeof table[law].box);
    assert_memory_equal(model.direction.c, table[law].c, sizeof table[law].c);
    assert_true(model.force.pair == table[law].pair && model.force.soften == 0.0);
    assert_true(model.share[0] == 1.0 && model.share[1] == 1.0);
  }
}

/* Lungs of one person come out alike whatever state they were scanned in. */
static void test_scan_below_full_gives_the_full_lungs_back(void **state) {
  (void)state;
  static const struct {
    double g[3], volume;
    supine_law law;
    supine_scan_kind kind;
  } scans[] = {
      {{0, 1, 0}, -3000.0, SUPINE_LAW_DEEP, SUPINE_SCAN_VOLUME},
      {{0, 0.9659258262890683, 0.25881904510252074}, -2200.0, SUPINE_LAW_DEEP, SUPINE_SCAN_VOLUME},
      {{0, -1, 0}, -0.53 * 6000.0, SUPINE_LAW_DEEP, SUPINE_SCAN_REST},
      {{1, 0, 0}, -900.0, SUPINE_LAW_DEEP, SUPINE_SCAN_VOLUME}};
  supine_lungs full = made_lungs();
  const size_t n = full.mesh.vertex_count;
  const supine_resting resting = supine_reference_resting_default();
  for (size_t s = 0; s < sizeof scans / sizeof *scans; ++s) {
    const supine_model model = supine_physics_model(scans[s].law);
    const supine_scan scan = {
        scans[s].kind, {scans[s].g[0], scans[s].g[1], scans[s].g[2]}, scans[s].volume};
    supine_lungs lungs = scan_of(&full, &model, scans[s].g, scans[s].volume);
    supine_reference found;
    supine_error error = {0};
    double *scanned = malloc(3 * n * sizeof *scanned);
    memcpy(scanned, lungs.mesh.vertices, 3 * n * sizeof *scanned);
    if (supine_reference_find(&lungs, &model, &scan, &resting, &found, &error) != SUPINE_OK) {
      fail_msg("%s", error.message);
    }
    const double off = farthest(lungs.mesh.vertices, full.mesh.vertices, n);
    printf("scan %zu: %zu steps, moved up to %.1f mm, full surface within %.1e mm\n", s,
           found.steps, found.moved, off);
    assert_true(found.known && found.steps > 2 && found.moved > 5.0);
    assert_true(off < 2.0 * promised);
    assert_true(fabs(found.full_volume - 6000.0) < 0.01);
    assert_true(fabs(found.scan_volume - scans[s].volume) < 0.01);
    assert_true(fabs(1e-3 * supine_mesh_volume(&lungs.mesh) - 6000.0) < 0.01);
    supine_lungs again = scan_of(&lungs, &model, scans[s].g, found.scan_volume);
    assert_true(farthest(again.mesh.vertices, scanned, n) < promised);
    free(scanned);
    supine_lungs_free(&again);
    supine_lungs_free(&lungs);
  }
  supine_lungs_free(&full);
}

/* What the library makes of a basis from a scan that was not full. */
static void test_basis_reproduces_its_scan_and_rests_where_it_should(void **state) {
  (void)state;
  static const double tilted[3] = {0.0, 0.9396926207859084, -0.3420201433256687};
  supine_lungs full = made_lungs();
  const size_t n = full.mesh.vertex_count;
  const supine_resting resting = supine_reference_resting_default();
  supine_precompute_options options = {
      .model = supine_physics_model(SUPINE_LAW_DEEP), .band = 15, .modes = 16, .held_out = 20};
  supine_lungs lungs = scan_of(&full, &options.model, tilted, -2500.0);
  double *scanned = malloc(3 * n * sizeof *scanned);
  memcpy(scanned, lungs.mesh.vertices, 3 * n * sizeof *scanned);
  const supine_scan scan = {SUPINE_SCAN_VOLUME, {tilted[0], tilted[1], tilted[2]}, -2500.0};
  supine_reference reference;
  supine_precompute_report report;
  supine_error error = {0};
  assert_int_equal(
      supine_reference_find(&lungs, &options.model, &scan, &resting, &reference, &error),
      SUPINE_OK);
  options.reference = &reference;
  if (supine_precompute(&lungs, &options, path, &report, &error) != SUPINE_OK) {
    fail_msg("%s", error.message);
  }
  assert_true(report.accuracy.volume == 1.0 && report.accuracy.rms_mm < 0.1);
  supine_basis *basis = NULL;
  assert_int_equal(supine_basis_open(path, &basis, &error), SUPINE_OK);
  double weights[SUPINE_MODES_MAX];
  double scales[SUPINE_LUNGS_MAX];
  float *xyz = malloc(3 * n * sizeof *xyz);
  double *placed = malloc(3 * n * sizeof *placed);
  assert_true(fabs(posed_scan(basis) + 2500.0) <
              3.0); /* of the anchored surface: half a permille */
  assert_int_equal(supine_basis_weights(basis, tilted, weights), SUPINE_OK);
  assert_int_equal(posed_scale(basis, weights, posed_scan(basis), scales, &error), SUPINE_OK);
  assert_true(scales[0] < 0.0);
  scales[1] = scales[0];
  supine_deform(basis, POSED(basis, weights, scales), xyz);
  for (size_t i = 0; i < 3 * n; ++i) {
    placed[i] = (double)xyz[i];
  }
  printf("scan reproduced within %.4f mm; basis errs by %.4f mm RMS\n",
         farthest(placed, scanned, n), report.accuracy.rms_mm);
  assert_true(farthest(placed, scanned, n) < promised);
  for (size_t axis = 0; axis < 6; ++axis) {
    double g[3] = {0.0, 0.0, 0.0};
    double rest = 0.0;
    g[axis / 2] = axis % 2 == 0 ? 3.0 : -0.2; /* any length */
    assert_int_equal(posed_rest(basis, g, &rest), SUPINE_OK);
    assert_true(fabs(rest - (resting.share[axis] - 1.0) * 6000.0) < 3.0); /* likewise */
  }
  const double none[3] = {0.0, 0.0, 0.0};
  double rest = 0.0;
  assert_int_equal(posed_rest(basis, none, &rest), SUPINE_ERROR_ARGUMENT);
  supine_basis_close(basis);
  free(xyz);
  free(placed);
  free(scanned);
  supine_lungs_free(&lungs);
  supine_lungs_free(&full);
}

/* Volume of the surface at positions, mL. */
static double volume_at(const supine_lungs *lungs, const float *xyz) {
  supine_mesh moved = lungs->mesh;
  moved.vertices = malloc(3 * moved.vertex_count * sizeof *moved.vertices);
  assert_non_null(moved.vertices);
  for (size_t i = 0; i < 3 * moved.vertex_count; ++i) {
    moved.vertices[i] = (double)xyz[i];
  }
  const double volume = 1e-3 * supine_mesh_volume(&moved);
  free(moved.vertices);
  return volume;
}

/* A basis moves its surface by as much as it was asked. */
static void check_volume(const supine_lungs *lungs, const supine_basis *basis, const double g[3],
                         double wanted) {
  double weights[SUPINE_MODES_MAX];
  double scales[2];
  float *xyz = malloc(3 * lungs->mesh.vertex_count * sizeof *xyz);
  assert_non_null(xyz);
  assert_int_equal(supine_basis_weights(basis, g, weights), SUPINE_OK);
  assert_int_equal(posed_scale(basis, weights, wanted, scales, NULL), SUPINE_OK);
  scales[1] = scales[0];
  supine_deform(basis, POSED(basis, weights, scales), xyz);
  const double is = volume_at(lungs, xyz) - volume_at(lungs, supine_basis_vertices(basis));
  if (fabs(is - wanted) > 0.02) {
    fail_msg("%.4f mL were asked, and %.4f came", wanted, is);
  }
  free(xyz);
}

/* A scan said to be at rest is where its posture rests, to rounding, not by way of the harmonics.
 */
static void test_scan_at_rest_is_where_its_posture_rests(void **state) {
  (void)state;
  static const double postures[][3] = {
      {0, 1, 0}, {1, 0, 0}, {0, 0, -1}, {0, 0.9659258262890683, 0.25881904510252074}};
  supine_lungs full = made_lungs();
  const supine_resting resting = supine_reference_resting_default();
  for (size_t p = 0; p < sizeof postures / sizeof *postures; ++p) {
    const double *g = postures[p];
    const double share = supine_reference_along_axes(resting.share, g);
    supine_precompute_options options = {
        .model = supine_physics_model(SUPINE_LAW_DEEP), .band = 15, .modes = 16, .held_out = 20};
    supine_lungs lungs = scan_of(&full, &options.model, g, (share - 1.0) * 6000.0);
    const supine_scan scan = {SUPINE_SCAN_REST, {g[0], g[1], g[2]}, 0.0};
    supine_reference reference;
    supine_precompute_report report;
    supine_error error = {0};
    supine_basis *basis = NULL;
    double rest = 0.0;
    options.reference = &reference;
    if (supine_reference_find(&lungs, &options.model, &scan, &resting, &reference, &error) !=
            SUPINE_OK ||
        supine_precompute(&lungs, &options, path, &report, &error) != SUPINE_OK ||
        supine_basis_open(path, &basis, &error) != SUPINE_OK) {
      fail_msg("%s", error.message);
    }
    assert_int_equal(posed_rest(basis, g, &rest), SUPINE_OK);
    printf("scanned at %.4f mL, rests at %.4f\n", posed_scan(basis), rest);
    assert_true(fabs(rest - posed_scan(basis)) < 0.01);
    /* or nothing was shown: the compressed field's full surface holds otherwise much */
    assert_true(fabs(rest - (share - 1.0) * 6000.0) > 0.1);
    check_volume(&lungs, basis, g, rest);
    check_volume(&lungs, basis, postures[(p + 1) % 4], rest + 500.0);
    supine_basis_close(basis);
    supine_lungs_free(&lungs);
  }
  supine_lungs_free(&full);
}

static void test_states_that_cannot_be_are_refused(void **state) {
  (void)state;
  supine_lungs lungs = made_lungs();
  const supine_model model = supine_physics_model(SUPINE_LAW_DEEP);
  const supine_resting resting = supine_reference_resting_default();
  supine_reference found;
  supine_error error = {0};
  supine_scan scan = {SUPINE_SCAN_VOLUME, {0, 1, 0}, 100.0};
  assert_int_equal(supine_reference_find(&lungs, &model, &scan, &resting, &found, &error),
                   SUPINE_ERROR_ARGUMENT);
  scan.volume = -60000.0; /* less than tissue is left */
  assert_int_equal(supine_reference_find(&lungs, &model, &scan, &resting, &found, &error),
                   SUPINE_ERROR_ARGUMENT);
  assert_non_null(strstr(error.message, "tissue"));
  supine_model rough = model; /* tears on its way up */
  rough.reach = 0.0;
  double *stiffness = malloc(lungs.mesh.vertex_count * sizeof *stiffness);
  uint64_t seed = 5;
  for (size_t i = 0; i < lungs.mesh.vertex_count; ++i) {
    stiffness[i] = exp(6.0 * helper_random(&seed));
  }
  rough.stiffness = stiffness;
  scan.volume = -4000.0;
  assert_int_equal(supine_reference_find(&lungs, &rough, &scan, &resting, &found, &error),
                   SUPINE_ERROR_NUMERICAL);
  printf("%s\n", error.message);
  assert_false(found.known);
  free(stiffness);
  supine_lungs_free(&lungs);
  supine_mesh open = helper_lump(6, 70.0, 3);
  open.triangle_count -= 1;
  assert_int_equal(supine_lungs_create(&open, 1, NULL, &lungs, NULL), SUPINE_OK);
  scan.kind = SUPINE_SCAN_REST;
  assert_int_equal(supine_reference_find(&lungs, &model, &scan, &resting, &found, &error),
                   SUPINE_ERROR_OPEN_SURFACE);
  scan.kind = SUPINE_SCAN_FULL;
  assert_int_equal(supine_reference_find(&lungs, &model, &scan, &resting, &found, &error),
                   SUPINE_OK);
  assert_false(found.known);
  supine_lungs_free(&lungs);
  supine_mesh_free(&open);
}

/* A lung given alone has nearly the field that it has beside its fellow. */
static void test_lung_alone_moves_as_in_its_pair(void **state) {
  (void)state;
  static const char *const names[] = {"lungs/chaste_left.ply", "lungs/chaste_right.ply"};
  static const double postures[][3] = {{0, 1, 0},  {0, -1, 0}, {1, 0, 0},
                                       {-1, 0, 0}, {0, 0, -1}, {0, 0, 1}};
  const supine_model model = supine_physics_model(SUPINE_LAW_DEEP);
  supine_lungs pair = {0};
  supine_lungs alone[2];
  if (!helper_real_lungs(names, 2, SUPINE_AXES_AUTO, &pair) ||
      !helper_real_lungs(&names[0], 1, SUPINE_AXES_AUTO, &alone[0]) ||
      !helper_real_lungs(&names[1], 1, SUPINE_AXES_AUTO, &alone[1])) {
    skip();
  }
  for (size_t p = 0; p < 6; ++p) {
    supine_solution both;
    assert_int_equal(supine_physics_solve(&pair, &model, postures[p], &both, NULL), SUPINE_OK);
    for (size_t side = 0; side < 2; ++side) {
      supine_solution one;
      double square = 0.0;
      assert_int_equal(supine_physics_solve(&alone[side], &model, postures[p], &one, NULL),
                       SUPINE_OK);
      for (size_t i = 0; i < one.vertex_count; ++i) {
        const double miss = one.catch_[i] - both.catch_[pair.lung_begin[side] + i];
        square += miss * miss;
      }
      const double rms = sqrt(square / (double)one.vertex_count);
      printf("posture %zu, %s alone: F within %.4f RMS\n", p, side == 0 ? "left" : "right", rms);
      assert_true(rms < 0.03);
      supine_physics_solution_free(&one);
    }
    supine_physics_solution_free(&both);
  }
  supine_lungs_free(&pair);
  supine_lungs_free(&alone[0]);
  supine_lungs_free(&alone[1]);
}

static int make_path(void **state) {
  (void)state;
  const int file = mkstemp(path);
  return file < 0 ? -1 : close(file);
}

static int remove_path(void **state) {
  (void)state;
  return unlink(path);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_axes_values_met_and_harmonics_agree_everywhere),
      cmocka_unit_test(test_resting_defaults_and_options),
      cmocka_unit_test(test_laws_constants_are_as_tabled),
      cmocka_unit_test(test_deep_law_supine_is_its_unsplit_form),
      cmocka_unit_test(test_scan_below_full_gives_the_full_lungs_back),
      cmocka_unit_test(test_basis_reproduces_its_scan_and_rests_where_it_should),
      cmocka_unit_test(test_scan_at_rest_is_where_its_posture_rests),
      cmocka_unit_test(test_states_that_cannot_be_are_refused),
      cmocka_unit_test(test_lung_alone_moves_as_in_its_pair)};
  return cmocka_run_group_tests(tests, make_path, remove_path);
}
