/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test the surface at full inflation, estimated from scans in any state, and the volume at rest in
 * each posture. */
#include "tests/helpers/findings.h"
#include "tests/helpers/test.h"

#include <supine/runtime.h>
#include <supine/sh.h>
#include <supine/volume.h>

#include "precompute/lungs/phantom.h"
#include "precompute/physics/reference.h"
#include "precompute/physics/solve.h"
#include "precompute/precompute.h"
#include "tests/helpers/basis_helpers.h"

#include "tests/helpers/lungs_helpers.h"

static const double promised = 0.005; /* documented limit of the error in the scan's state, mm */

static char path[] = "/tmp/supine-reference-XXXXXX";

static supine_lungs made_lungs(void) {
  supine_mesh mesh = {0};
  supine_lungs lungs = {0};
  assert_int_equal(supine_lungs_phantom_create(1200, 6000.0, &mesh, NULL), SUPINE_OK);
  assert_int_equal(supine_lungs_create(&mesh, 1, NULL, &lungs, NULL), SUPINE_OK);
  supine_mesh_free(&mesh);
  return lungs;
}

static supine_scan scan_named(const char *text) {
  supine_scan scan;
  supine_error error = {0};
  if (supine_physics_reference_scan_parse(text, &scan, &error) != SUPINE_OK) {
    fail_msg("%s", error.message);
  }
  return scan;
}

/* Return the reference surface of lungs scanned at full inflation. */
static supine_reference reference_of(supine_lungs *full, const supine_model *model) {
  const supine_scan scan = scan_named("full");
  const supine_resting resting = supine_physics_resting_default();
  supine_reference found;
  assert_int_equal(supine_physics_reference_find(full, model, &scan, &resting, &found, NULL),
                   SUPINE_OK);
  assert_int_equal(found.solves, 0);
  return found;
}

/* Return a scan of the same lungs with gravity along g and `volume` mL in total, which the model
 * divides between the lungs. */
static supine_lungs scan_of(supine_lungs *full, const supine_model *model, const double g[3],
                            double volume) {
  const supine_reference reference = reference_of(full, model);
  supine_solution solution = {0};
  supine_mesh moved = full->mesh;
  supine_lungs scan = {0};
  double ml[2];
  double rest[2];
  double gains[2][3];
  assert_int_equal(supine_physics_solve(full, model, g, &solution, NULL), SUPINE_OK);
  supine_physics_reference_share_out(&reference, g, volume, ml);
  (void)supine_physics_reference_rest(&reference, g, rest);
  for (size_t lung = 0; lung < full->lung_count; ++lung) {
    assert_int_equal(supine_volume_form_gains(&solution.form[lung], model->bend,
                                              rest[lung] - reference.full_volume[lung],
                                              ml[lung] - reference.full_volume[lung], gains[lung],
                                              NULL),
                     SUPINE_OK);
  }
  for (size_t i = 0; i < 3 * solution.vertex_count; ++i) {
    solution.directions[i] *= gains[i >= 3 * full->lung_begin[1]][i % 3];
  }
  moved.vertices = malloc(3 * moved.vertex_count * sizeof(double));
  supine_physics_solution_apply(&solution, &full->mesh, 1.0, moved.vertices);
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

TEST(test_resting_axes_values_interpolated_by_harmonics) {
  static const double values[6] = {-3.1, 2.7, 0.4, -1.9, 5.3, 0.08};
  double harmonics[9];
  uint64_t seed = 77;
  supine_physics_resting_harmonics(values, harmonics);
  for (size_t axis = 0; axis < 6; ++axis) {
    double g[3] = {0.0, 0.0, 0.0};
    g[axis / 2] = axis % 2 == 0 ? 1.0 : -1.0;
    assert_true(fabs(supine_physics_resting_along_axes(values, g) - values[axis]) < 1e-15 * 16.0);
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
    assert_true(fabs(sum - supine_physics_resting_along_axes(values, g)) < 1e-14 * 16.0);
  }
}

TEST(test_resting_options_override_defaults) {
  static const double left[6] = {0.462, 0.629, 0.467, 0.519, 0.467, 0.538};
  static const double right[6] = {0.610, 0.486, 0.492, 0.531, 0.492, 0.566};
  supine_resting resting = supine_physics_resting_default();
  supine_error error = {0};
  assert_memory_equal(resting.share[0], left, sizeof left);
  assert_memory_equal(resting.share[1], right, sizeof right);
  /* Set the volume at rest of both lungs together to 0.5 of full inflation. One factor scales the
   * default shares of the two lungs, and those of all postures that are not given. */
  assert_int_equal(supine_physics_resting_set(&resting, "HFP", "0.5", &error), SUPINE_OK);
  assert_true(fabs(0.45 * resting.share[0][3] + 0.55 * resting.share[1][3] - 0.5) < 1e-15);
  assert_true(fabs(resting.share[0][3] / resting.share[1][3] - 0.519 / 0.531) < 1e-15);
  const double factor = 0.5 / (0.45 * 0.519 + 0.55 * 0.531);
  assert_true(fabs(resting.share[0][5] - 0.538 * factor) < 1e-15);
  assert_int_equal(supine_physics_resting_set(&resting, "left", "0.4/0.52", &error), SUPINE_OK);
  assert_true(resting.share[0][0] == 0.4 && resting.share[1][0] == 0.52);
  assert_int_equal(supine_physics_resting_set(&resting, "pron", "0.5", &error),
                   SUPINE_ERROR_ARGUMENT);
  assert_says(error.message, "prone");
  static const char *const bad[] = {"0.1",  "0",        "-0.4", "1.01",   "nan",      "x",  "0.4x",
                                    "0.4/", "0.4/0.05", "-5mL", "2600 L", "0.4/0.5/", "mL", "1.0"};
  for (size_t i = 0; i < sizeof bad / sizeof *bad; ++i) {
    const supine_resting before = resting;
    assert_int_equal(supine_physics_resting_set(&resting, "right", bad[i], &error),
                     SUPINE_ERROR_ARGUMENT);
    assert_memory_equal(&before, &resting, sizeof before);
  }
  /* The share in COPD scales all postures, up to 1, and counts as assumed. */
  resting = supine_physics_resting_default();
  assert_int_equal(supine_physics_resting_set(&resting, "copd", NULL, &error), SUPINE_OK);
  assert_true(fabs(resting.share[0][5] - 0.538 * 0.64 / 0.48) < 1e-15);
  assert_true(resting.spread == 0.11 && !supine_physics_resting_given(&resting));
}

/* A resting volume in mL is converted to a share of full inflation. The default shares of the other
 * postures are multiplied by the mean of the ratios, given / default volume. */
TEST(test_resting_volumes_become_shares) {
  static const int side[2] = {1, -1};
  static const double full[2] = {2500.0, 3100.0};
  supine_resting resting = supine_physics_resting_default();
  const supine_resting usual = resting;
  supine_error error = {0};
  char text[256];
  assert_int_equal(supine_physics_resting_set(&resting, "supine", "3000mL", &error), SUPINE_OK);
  assert_int_equal(supine_physics_resting_set(&resting, "prone", "0.6/0.6", &error), SUPINE_OK);
  assert_int_equal(supine_physics_resting_settle(&resting, 2, side, full, &error), SUPINE_OK);
  const double supine = 3000.0 / (2500.0 * 0.467 + 3100.0 * 0.492);
  const double prone = 0.6 * 5600.0 / (2500.0 * 0.519 + 3100.0 * 0.531);
  assert_true(fabs(2500.0 * resting.share[0][2] + 3100.0 * resting.share[1][2] - 3000.0) < 1e-9);
  for (size_t axis = 0; axis < 6; ++axis) {
    for (size_t k = 0; k < 2; ++k) {
      const double factor = axis == 2 ? supine : 0.5 * (supine + prone);
      const double wanted = axis == 3 ? 0.6 : factor * usual.share[k][axis];
      assert_true(fabs(resting.share[k][axis] - wanted) < 1e-12);
    }
  }
  supine_physics_resting_print(&usual, text, sizeof text);
  assert_string_equal(text, "left=0.462/0.61,right=0.629/0.486,supine=0.467/0.492,"
                            "prone=0.519/0.531,inverted=0.467/0.492,upright=0.538/0.566");
  resting = usual;
  assert_int_equal(supine_physics_resting_set(&resting, "supine", "5700mL", &error), SUPINE_OK);
  assert_int_equal(supine_physics_resting_settle(&resting, 2, side, full, &error),
                   SUPINE_ERROR_ARGUMENT);
  assert_string_equal(error.remedies[1].argument, "resting");
}

TEST(test_scan_parse_states_accepted_or_refused) {
  static const struct {
    const char *text;
    supine_volume_kind kind;
    double ml, g[3];
  } good[] = {{"full", SUPINE_VOLUME_FULL, 0, {0, 1, 0}},
              {"rest", SUPINE_VOLUME_REST, 0, {0, 1, 0}},
              {"rest+300", SUPINE_VOLUME_REST, 300, {0, 1, 0}},
              {"left:rest", SUPINE_VOLUME_REST, 0, {1, 0, 0}},
              {"prone:rest-200mL", SUPINE_VOLUME_REST, -200, {0, -1, 0}},
              {"full-2000", SUPINE_VOLUME_FULL, -2000, {0, 1, 0}},
              {"upright:full", SUPINE_VOLUME_FULL, 0, {0, 0, -1}}};
  static const struct {
    const char *text, *said;
  } bad[] = {{"supine:-3000", "full-3000"},
             {"scan", "not the state of a scan"},
             {"2600mL", "not the state of a scan"},
             {"prone", "not the state of a scan"},
             {"sopine:rest", "supine"},
             {"left=rest,right=rest", "not the state of a scan"}};
  supine_scan scan;
  supine_error error = {0};
  for (size_t i = 0; i < sizeof good / sizeof *good; ++i) {
    scan = scan_named(good[i].text);
    assert_true(scan.known && scan.state.volume.kind == good[i].kind);
    assert_true(scan.state.volume.ml == good[i].ml);
    assert_memory_equal(scan.state.gravity, good[i].g, sizeof good[i].g);
  }
  assert_false(scan_named("none").known);
  for (size_t i = 0; i < sizeof bad / sizeof *bad; ++i) {
    assert_int_equal(supine_physics_reference_scan_parse(bad[i].text, &scan, &error),
                     SUPINE_ERROR_ARGUMENT);
    assert_says(error.message, bad[i].said);
  }
}

/* Above rest, both lungs are inflated by the same fraction of the difference between their volumes
 * at rest and at full inflation (Milic-Emili). Below rest, the ratio of their volumes is that at
 * rest. */
TEST(test_share_out_any_volume_divided_along_straight_lines) {
  static const double left_side[3] = {1.0, 0.0, 0.0};
  static const double upright[3] = {0.0, 0.0, -1.0};
  const supine_reference r = {.known = true,
                              .resting = supine_physics_resting_default(),
                              .lung_count = 2,
                              .side = {1, -1},
                              .full_volume = {2000.0, 3000.0}};
  double ml[2];
  assert_true(fabs(supine_physics_reference_rest(&r, left_side, ml) - (924.0 + 1830.0)) < 1e-9);
  supine_physics_reference_share_out(&r, left_side, 924.0 + 1830.0 + 500.0, ml);
  const double t = 500.0 / (5000.0 - 2754.0);
  assert_true(fabs(ml[0] - (924.0 + t * (2000.0 - 924.0))) < 1e-9);
  assert_true(fabs(ml[1] - (1830.0 + t * (3000.0 - 1830.0))) < 1e-9);
  supine_physics_reference_share_out(&r, left_side, 0.9 * 2754.0, ml);
  assert_true(fabs(ml[0] - 0.9 * 924.0) < 1e-9 && fabs(ml[1] - 0.9 * 1830.0) < 1e-9);
  assert_true(fabs(supine_physics_reference_full(&r, upright, ml) - 1.109 * 5000.0) < 1e-9);
  supine_physics_reference_share_out(&r, upright, 1.109 * 5000.0, ml);
  assert_true(fabs(ml[0] - 1.109 * 2000.0) < 1e-9 && fabs(ml[1] - 1.109 * 3000.0) < 1e-9);
}

TEST(test_law_constants_equal_table) {
  static const struct {
    const char *name;
    double base, gain, box[3], c[6], shear, reach;
    bool pair;
  } table[SUPINE_LAW_COUNT] = {
      {"deep", 0.875, 0.4, {0, -0.15, 0}, {6, 2.6, 15, 1, 16, 1.3}, 0.4, 10.0, true},
      {"paper", 0.0, 1.0, {0, 0, 0}, {2, 1.5, 1.5, 1, 16, 1.4}, 0.0, 0.0, false}};
  for (int law = 0; law < SUPINE_LAW_COUNT; ++law) {
    const supine_model model = supine_physics_model((supine_law)law);
    assert_string_equal(supine_physics_law_names[law], table[law].name);
    assert_true(model.law == (supine_law)law && model.force.base == table[law].base);
    assert_true(model.force.gain == table[law].gain && model.reach == table[law].reach);
    assert_memory_equal(model.force.box, table[law].box, sizeof table[law].box);
    assert_memory_equal(model.direction.c, table[law].c, sizeof table[law].c);
    assert_true(model.direction.shear == table[law].shear);
    assert_true(model.force.pair == table[law].pair && model.force.soften == 0.0);
    assert_true(model.share[0] == 1.0 && model.share[1] == 1.0);
  }
}

/* A scan in any state gives the same surface at full inflation. */
TEST(test_reference_scan_of_any_state_recovers_full_lungs) {
  static const struct {
    const char *scanned;
    double volume; /* mL: total, or relative to the volume at rest if `scanned` names rest */
  } scans[] = {
      {"supine:full-3000", 3000.0},    {"supine+15:full-2200", 3800.0}, {"prone:rest", 0.0},
      {"left:full-900", 5100.0},       {"right:rest+800", 800.0},       {"supine:rest-150", -150.0},
      {"upright:full", 1.109 * 6000.0}};
  supine_lungs full = made_lungs();
  const size_t n = full.mesh.vertex_count;
  const supine_model model = supine_physics_model(SUPINE_LAW_DEEP);
  const supine_resting resting = supine_physics_resting_default();
  const supine_reference whole = reference_of(&full, &model);
  for (size_t s = 0; s < sizeof scans / sizeof *scans; ++s) {
    const supine_scan scan = scan_named(scans[s].scanned);
    const double *g = scan.state.gravity;
    const bool rests = scan.state.volume.kind == SUPINE_VOLUME_REST;
    double ml[2];
    const double volume =
        scans[s].volume + (rests ? supine_physics_reference_rest(&whole, g, ml) : 0.0);
    supine_lungs lungs = scan_of(&full, &model, g, volume);
    supine_reference found;
    supine_error error = {0};
    double *scanned = malloc(3 * n * sizeof *scanned);
    memcpy(scanned, lungs.mesh.vertices, 3 * n * sizeof *scanned);
    if (supine_physics_reference_find(&lungs, &model, &scan, &resting, &found, &error) !=
        SUPINE_OK) {
      fail_msg("%s", error.message);
    }
    const double off = farthest(lungs.mesh.vertices, full.mesh.vertices, n);
    printf("%s: %zu solves, surface at full inflation off by %.1e mm\n", scans[s].scanned,
           found.solves, off);
    assert_true(found.known && found.solves > 2 && found.solves <= 15);
    assert_true(off < 2.0 * promised);
    supine_physics_reference_share_out(&whole, g, volume, ml);
    for (size_t lung = 0; lung < 2; ++lung) {
      assert_true(fabs(found.full_volume[lung] - whole.full_volume[lung]) < 0.01);
      assert_true(fabs(found.scan_volume[lung] - (ml[lung] - whole.full_volume[lung])) < 0.01);
    }
    assert_true(fabs(1e-3 * supine_mesh_volume(&lungs.mesh) - 6000.0) < 0.01);
    supine_lungs again = scan_of(&lungs, &model, g, volume);
    assert_true(farthest(again.mesh.vertices, scanned, n) < promised);
    free(scanned);
    supine_lungs_free(&again);
    supine_lungs_free(&lungs);
  }
  supine_lungs_free(&full);
}

/* By the equations of ECSC 1993, a man of 1.78 m has a total lung capacity of 7.1422 L upright and
 * 6.4402 L supine. The expected volume is the latter plus 0.86 L of tissue. */
TEST(test_capacity_height_and_sex_literal) {
  static const struct {
    supine_person person;
    double range[2];
    const char *text;
  } known[] = {{{178.0, SUPINE_SEX_MALE}, {7300.2, 7300.2}, "expected 7300"},
               {{165.0, SUPINE_SEX_FEMALE}, {5458.7, 5458.7}, "expected 5459"},
               {{170.0, SUPINE_SEX_UNKNOWN}, {5756.3, 6724.0}, "an adult's 5756 to 6724"},
               {{0.0, SUPINE_SEX_UNKNOWN}, {4566.0, 8525.0}, "an adult's 4566 to 8525"}};
  const supine_reference pair = {.lung_count = 2};
  for (size_t i = 0; i < sizeof known / sizeof *known; ++i) {
    double range[2];
    supine_physics_reference_capacity(&known[i].person, range);
    assert_true(fabs(range[0] - known[i].range[0]) < 1.0);
    assert_true(fabs(range[1] - known[i].range[1]) < 1.0);
    char text[64] = "";
    supine_physics_reference_compare(&pair, &known[i].person, text, sizeof text);
    assert_string_equal(text, known[i].text);
  }
}

/* By the equation of Hall et al. 2021 without the spline of age, the FRC of a man of 1.78 m and 45
 * years is 3.4989 L; 0.806 L less supine, and 0.86 L of tissue. A scan at rest is not predicted. */
TEST(test_predict_rest_height_and_sex_literal) {
  static const supine_person man = {178.0, SUPINE_SEX_MALE};
  static const supine_person woman = {165.0, SUPINE_SEX_FEMALE};
  static const supine_person unknown = {178.0, SUPINE_SEX_UNKNOWN};
  const supine_reference full = {.scan = scan_named("full"), .lung_count = 2, .side = {1, -1}};
  const supine_reference rest = {.scan = scan_named("supine:rest"), .lung_count = 2};
  supine_resting resting = supine_physics_resting_default();
  supine_physics_reference_predict_rest(&full, &unknown, &resting);
  supine_physics_reference_predict_rest(&rest, &man, &resting);
  assert_true(resting.ml[2] == 0.0 && !resting.predicted);
  supine_physics_reference_predict_rest(&full, &man, &resting);
  assert_true(resting.predicted);
  assert_true(fabs(resting.ml[2] - 3552.9) < 1.0);
  supine_physics_reference_predict_rest(&full, &woman, &resting);
  assert_true(fabs(resting.ml[2] - 2797.6) < 1.0);
}

/* The given state of a scan is reported as doubtful if full inflation is not that of people of the
 * given height, is more than anyone's, or
 * if the given volume at rest disagrees with the scan. */
TEST(test_doubt_implausible_volume_has_remedy) {
  static const struct {
    const char *scanned;
    double height;      /* cm; 0 if not given */
    double full;        /* volume of each lung at full inflation, mL */
    double rest;        /* volume at rest supine given by --resting, mL; 0 if not given */
    const char *doubts; /* part of the expected warning; NULL if none is expected */
    const char *advice; /* value of the first remedy, or "" */
  } known[] = {{"full", 0.0, 3000.0, 0.0, NULL, ""},
               {"full", 0.0, 600.0, 0.0, NULL, ""}, /* a child's */
               {"full", 160.0, 1900.0, 0.0, "3800 mL (an adult's 5161 to", "supine:rest"},
               {"full", 160.0, 1950.0, 0.0, NULL, ""},
               {"supine:rest", 0.0, 5100.0, 0.0, "hold 10200 mL", "supine:rest+1000"},
               {"supine:rest", 0.0, 3000.0, 2400.0, "say 2400 mL", ""},
               {"supine:rest", 0.0, 3000.0, 2600.0, NULL, ""},
               {"supine:rest+300", 0.0, 3000.0, 2300.0, NULL, ""},
               {"prone:rest", 0.0, 3000.0, 2000.0, NULL, ""}};
  for (size_t i = 0; i < sizeof known / sizeof *known; ++i) {
    const supine_person person = {.height = known[i].height};
    const double full = known[i].full;
    supine_resting resting = supine_physics_resting_default();
    supine_reference reference = {.scan = scan_named(known[i].scanned),
                                  .lung_count = 2,
                                  .side = {1, -1},
                                  .resting = resting,
                                  .full_volume = {full, full}};
    supine_findings findings = {.count = 0};
    if (reference.scan.state.volume.kind == SUPINE_VOLUME_REST) {
      reference.scan_volume[0] = reference.scan_volume[1] = 1300.0 - full;
    }
    resting.ml[2] = known[i].rest;
    supine_physics_reference_doubt(&reference, &person, &resting, &findings);
    const char *text = findings_text(&findings);
    assert_string_equal(findings.list[0].remedies[0].value, known[i].advice);
    if (known[i].doubts == NULL ? text[0] != '\0' : strstr(text, known[i].doubts) == NULL) {
      fail_msg("%s of %g mL: '%s'", known[i].scanned, full, text);
    }
  }
}

/* Check that full inflation of real lungs, whose volume at rest is 0.35 of the full volume, is
 * found in at most 30 solves. */
static void check_full_inflation(const char *const *names, supine_axes axes) {
  static const char *const states[] = {"supine:rest", "left:rest", "prone:rest", "upright:rest"};
  for (size_t s = 0; s < sizeof states / sizeof *states; ++s) {
    const supine_model model = supine_physics_model(SUPINE_LAW_DEEP);
    const supine_scan scan = scan_named(states[s]);
    supine_resting resting = supine_physics_resting_default();
    supine_lungs lungs = {0};
    supine_reference found;
    supine_error error = {0};
    if (!helper_real_lungs(names, 2, axes, &lungs)) {
      skip();
    }
    assert_int_equal(supine_physics_resting_set(&resting, "supine", "0.35/0.35", &error),
                     SUPINE_OK);
    if (supine_physics_reference_find(&lungs, &model, &scan, &resting, &found, &error) !=
        SUPINE_OK) {
      fail_msg("%s %s: %s", names[0], states[s], error.message);
    }
    const double moved = farthest(lungs.mesh.vertices, lungs.scanned, lungs.mesh.vertex_count);
    printf("%s %s: %zu solves, displacement up to %.1f mm\n", names[0], states[s], found.solves,
           moved);
    assert_true(found.solves <= 30 && moved > 30.0);
    supine_lungs_free(&lungs);
  }
}

TEST(test_reference_example_lungs_at_rest_reach_full_inflation) {
  static const char *const names[] = {"left.obj", "right.obj"};
  check_full_inflation(names, SUPINE_AXES_AUTO);
}

TEST_FULL(test_reference_other_real_lungs_at_rest_reach_full_inflation) {
  static const char *const names[] = {"covid/covid001_left.ply", "covid/covid001_right.ply"};
  check_full_inflation(names, SUPINE_AXES_RAS);
}

/* Make a basis of lungs scanned in a state, and write its RMS error, mm, to `rms_mm`. */
static supine_basis *basis_of(supine_lungs *lungs, const supine_scan *scan, double *rms_mm) {
  const supine_resting resting = supine_physics_resting_default();
  supine_prepared prepared = {.source = {.lungs = *lungs},
                              .model = supine_physics_model(SUPINE_LAW_DEEP)};
  const supine_basis_choice choice = {.band = 15, .modes = 16, .held_out = 20};
  supine_basis_report report;
  supine_basis *basis = NULL;
  supine_error error = {0};
  if (supine_physics_reference_find(&prepared.source.lungs, &prepared.model, scan, &resting,
                                    &prepared.reference, &error) != SUPINE_OK ||
      helper_write_basis(path, &prepared, &choice, &report, &error) != SUPINE_OK ||
      supine_basis_open(path, &basis, &error) != SUPINE_OK) {
    fail_msg("%s", error.message);
  }
  *lungs = prepared.source.lungs;
  assert_true(report.accuracy.volume == 1.0 && report.accuracy.rms_mm < 0.1);
  *rms_mm = report.accuracy.rms_mm;
  return basis;
}

/* Return the vertices of a basis in a state (malloc). Set `ml` to the volume of each lung, mL. */
static double *positions_in(const supine_basis *basis, const supine_state *state, double *ml) {
  const size_t n = supine_basis_get_info(basis)->vertex_count;
  supine_pose pose;
  supine_error error = {0};
  float *xyz = malloc(3 * n * sizeof *xyz);
  double *placed = malloc(3 * n * sizeof *placed);
  assert_true(xyz != NULL && placed != NULL);
  if (supine_basis_pose(basis, state, &pose, &error) != SUPINE_OK) {
    fail_msg("%s", error.message);
  }
  supine_deform(basis, &pose, xyz);
  for (size_t i = 0; i < 3 * n; ++i) {
    placed[i] = (double)xyz[i];
  }
  supine_basis_volumes(basis, &pose, ml);
  free(xyz);
  return placed;
}

/* A basis from a scan in any state reproduces the scan, and has the right surface and volumes at
 * rest. */
TEST(test_basis_of_any_scan_reproduces_scan_and_rest) {
  static const char *const scans[] = {"supine-20:full-2500", "supine:rest", "left:rest",
                                      "upright:rest+300", "upright:full"};
  const supine_model model = supine_physics_model(SUPINE_LAW_DEEP);
  supine_lungs full = made_lungs();
  const supine_reference whole = reference_of(&full, &model);
  for (size_t s = 0; s < sizeof scans / sizeof *scans; ++s) {
    const supine_scan scan = scan_named(scans[s]);
    const double *g = scan.state.gravity;
    double ml[2];
    double wanted[2];
    double rms = 0.0;
    const double at_rest = supine_physics_reference_rest(&whole, g, ml);
    const double at_full = supine_physics_reference_full(&whole, g, ml);
    const bool rests = scan.state.volume.kind == SUPINE_VOLUME_REST;
    supine_lungs lungs =
        scan_of(&full, &model, g, (rests ? at_rest : at_full) + scan.state.volume.ml);
    const size_t n = lungs.mesh.vertex_count;
    double *scanned = malloc(3 * n * sizeof *scanned);
    assert_non_null(scanned);
    memcpy(scanned, lungs.mesh.vertices, 3 * n * sizeof *scanned);
    supine_basis *basis = basis_of(&lungs, &scan, &rms);
    const supine_state as_scanned = supine_basis_scan(basis);
    double *placed = positions_in(basis, &as_scanned, ml);
    double *posed = positions_in(basis, &scan.state, ml);
    printf("%s: scan reproduced within %.4f and %.4f mm; error of the basis %.4f mm RMS\n",
           scans[s], farthest(placed, scanned, n), farthest(posed, scanned, n), rms);
    assert_true(farthest(placed, scanned, n) < promised);
    /* States other than rest depend on the volume at full inflation, which errs by a few mL. */
    assert_true(farthest(posed, scanned, n) <
                (rests && scan.state.volume.ml == 0.0 ? promised : 0.15));
    free(placed);
    free(posed);
    for (size_t axis = 0; axis < 6; ++axis) {
      supine_state rest = {.volume = {SUPINE_VOLUME_REST, 0.0}};
      rest.gravity[axis / 2] = axis % 2 == 0 ? 1.0 : -1.0;
      supine_physics_reference_rest(&whole, rest.gravity, wanted);
      free(positions_in(basis, &rest, ml));
      assert_true(fabs(ml[0] - wanted[0]) < 0.1 && fabs(ml[1] - wanted[1]) < 0.1);
    }
    supine_basis_close(basis);
    free(scanned);
    supine_lungs_free(&lungs);
  }
  supine_lungs_free(&full);
}

TEST(test_reference_impossible_states_refused) {
  supine_lungs lungs = made_lungs();
  const supine_model model = supine_physics_model(SUPINE_LAW_DEEP);
  const supine_resting resting = supine_physics_resting_default();
  supine_reference found;
  supine_error error = {0};
  static const struct {
    const char *scanned, *said;
  } bad[] = {{"full+100", "beyond full"},
             {"supine:rest+9000", "beyond full"},
             {"full-60000", "tissue"},
             {"supine:rest-40000", "tissue"}};
  for (size_t i = 0; i < sizeof bad / sizeof *bad; ++i) {
    const supine_scan scan = scan_named(bad[i].scanned);
    assert_int_equal(supine_physics_reference_find(&lungs, &model, &scan, &resting, &found, &error),
                     SUPINE_ERROR_ARGUMENT);
    assert_says(error.message, bad[i].said);
    assert_string_equal(error.remedies[0].argument, "scanned");
    assert_false(found.known);
  }
  /* A model whose surface folds on the way to full inflation. */
  supine_model rough = model;
  rough.reach = 0.0;
  double *stiffness = malloc(lungs.mesh.vertex_count * sizeof *stiffness);
  uint64_t seed = 5;
  for (size_t i = 0; i < lungs.mesh.vertex_count; ++i) {
    stiffness[i] = exp(6.0 * helper_random(&seed));
  }
  rough.stiffness = stiffness;
  supine_scan scan = scan_named("full-4000");
  assert_int_equal(supine_physics_reference_find(&lungs, &rough, &scan, &resting, &found, &error),
                   SUPINE_ERROR_NUMERICAL);
  printf("%s\n", error.message);
  assert_string_equal(error.remedies[2].value, "none");
  assert_false(found.known);
  free(stiffness);
  supine_lungs_free(&lungs);
}

TEST(test_solve_single_lung_moves_nearly_as_in_pair) {
  static const char *const names[] = {"left.obj", "right.obj"};
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
    supine_solution both = {0};
    assert_int_equal(supine_physics_solve(&pair, &model, postures[p], &both, NULL), SUPINE_OK);
    for (size_t side = 0; side < 2; ++side) {
      supine_solution one = {0};
      double square = 0.0;
      assert_int_equal(supine_physics_solve(&alone[side], &model, postures[p], &one, NULL),
                       SUPINE_OK);
      for (size_t i = 0; i < one.vertex_count; ++i) {
        const double miss = one.catch_[i] - both.catch_[pair.lung_begin[side] + i];
        square += miss * miss;
      }
      const double rms = sqrt(square / (double)one.vertex_count);
      printf("posture %zu, %s lung alone: catch off by %.4f RMS\n", p, side == 0 ? "left" : "right",
             rms);
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

TEST_GROUP(make_path, remove_path)
