/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test expandability: by region, from files, and how it changes displacements. */
#include <float.h>

#include "precompute/lungs/expandability.h"
#include "precompute/physics/solve.h"
#include "tests/helpers/test.h"

#include "tests/helpers/lungs_helpers.h"

static char path[] = "/tmp/supine-expandability-XXXXXX";
static supine_lungs lungs;

static int setup(void **state) {
  (void)state;
  const int file = mkstemp(path);
  supine_mesh lump = helper_lump(6, 80.0, 11);
  const supine_status status = supine_lungs_create(&lump, 1, NULL, &lungs, NULL);
  supine_mesh_free(&lump);
  return file < 0 || close(file) != 0 || status != SUPINE_OK ? -1 : 0;
}

static int teardown(void **state) {
  (void)state;
  supine_lungs_free(&lungs);
  return unlink(path);
}

TEST(test_expandability_regional_any_axis_follows_box_coordinate) {
  const size_t n = lungs.mesh.vertex_count;
  double *a = malloc(n * sizeof *a);
  for (int axis = 0; axis < 3; ++axis) {
    const supine_expandability_law linear = {SUPINE_EXPANDABILITY_LINEAR, axis, 0.5, 1.5};
    const supine_expandability_law ratios = {SUPINE_EXPANDABILITY_EXPONENTIAL, axis, 0.25, 4.0};
    double box[3];
    supine_tissue_expandability_regional(&lungs, &linear, a);
    for (size_t i = 0; i < n; ++i) {
      supine_lungs_box_coordinates(&lungs, i, box);
      assert_true(fabs(a[i] - 0.5 - box[axis]) <= 4.0 * DBL_EPSILON);
    }
    supine_tissue_expandability_regional(&lungs, &ratios, a);
    for (size_t i = 0; i < n; ++i) {
      supine_lungs_box_coordinates(&lungs, i, box);
      assert_true(fabs(log2(a[i]) + 2.0 - 4.0 * box[axis]) <= 1e-14);
    }
  }
  free(a);
}

TEST(test_expandability_load_with_or_without_vertex_column_same_values) {
  static const double wanted[] = {1.5, 0.25, 3e-2};
  static const char *const texts[] = {
      "expandability\n1.5\n0.25\n3e-2\n",
      "# made\n\nexpandability\r\n1.5\r\n 0.25 \r\n3e-2",
      "vertex,expandability\n2,3e-2\n0,1.5\n# and\n1,0.25\n",
  };
  for (size_t t = 0; t < 3; ++t) {
    double a[3] = {-1.0, -1.0, -1.0};
    supine_error error = {0};
    test_write(path, texts[t]);
    if (supine_tissue_expandability_load(path, 3, a, &error) != SUPINE_OK) {
      fail_msg("%s", error.message);
    }
    assert_memory_equal(a, wanted, sizeof a);
  }
}

TEST(test_expandability_load_bad_file_message_names_line_or_vertex) {
  static const struct {
    const char *text, *line, *detail;
  } bad[] = {
      {"expandability\n1\n-2\n3\n", ":3:", "-2 of vertex 1: it must be positive"},
      {"expandability\n1\n0\n3\n", ":3:", "0 of vertex 1: it must be positive"},
      {"expandability\n1\nnan\n3\n", ":3:", "\"nan\" is not a finite number"},
      {"expandability\n1\n1e999\n3\n", ":3:", "\"1e999\" is not a finite number"},
      {"expandability\n1\n1e-320\n3\n", ":3:", "vertex 1"},
      {"expandability\n1\n2\n", "", "vertex 2 of 3 has no value"},
      {"expandability\n1\n2\n3\n4\n", ":5:", "vertex 3: there is no such vertex"},
      {"expandability\n1\ntwo\n3\n", ":3:", "\"two\" is not a finite number"},
      {"expandability\n1\n2 2\n3\n", ":3:", "\"2 2\" is not"},
      {"1\n2\n3\n", ":1:", "no column \"expandability\""},
      {"", "", "empty"},
      {"vertex,expandability\n0,1\n2,1\n", "", "vertex 1 of 3 has no"},
      {"vertex,expandability\n0,1\n1,1\n0,2\n", ":4:", "vertex 0: the vertex was given before"},
      {"vertex,expandability\n0,1\n7,1\n", ":3:", "vertex 7: there is no"},
      {"vertex,expandability\n0,1\n-1,1\n", ":3:", "vertex -1: there is no such vertex"},
      {"vertex,expandability\n0,1\n1.5,1\n", ":3:", "vertex 1.5: there is no such vertex"},
      {"vertex,expandability\n0,1\n1;1\n", ":3:", "1 field, but the header has 2"},
      {"vertex,expandability\n0,1\n99999999999999999999,1\n", ":3:", "1e+20: there is no such"},
      {"vertex,expandability\n0,1\n1,-4\n", ":3:", "-4 of vertex 1: it must be positive"},
  };
  for (size_t i = 0; i < sizeof bad / sizeof *bad; ++i) {
    double a[3];
    supine_error error = {0};
    test_write(path, bad[i].text);
    assert_int_equal(supine_tissue_expandability_load(path, 3, a, &error), SUPINE_ERROR_FORMAT);
    assert_says(error.message, bad[i].line);
    assert_says(error.message, bad[i].detail);
  }
}

TEST(test_expandability_load_binary_or_missing_file_refused) {
  double a[3];
  FILE *file = fopen(path, "wb");
  assert_non_null(file);
  (void)fwrite("a\n1\0\n", 1, 5, file);
  assert_int_equal(fclose(file), 0);
  assert_int_equal(supine_tissue_expandability_load(path, 3, a, NULL), SUPINE_ERROR_FORMAT);
  supine_error error = {0};
  assert_int_equal(supine_tissue_expandability_load("/nowhere/a.csv", 3, a, &error),
                   SUPINE_ERROR_READ);
  assert_says(error.message, "/nowhere/a.csv");
  assert_int_equal(supine_tissue_expandability_load("/tmp", 3, a, NULL), SUPINE_ERROR_READ);
}

/* Doubling the expandability of all tissue changes nothing. If it differs between regions,
 * expandable tissue moves more than in a uniform lung, and stiff tissue moves less. */
TEST(test_solve_uneven_expandability_expandable_tissue_moves_more) {
  const size_t n = lungs.mesh.vertex_count;
  const double g[3] = {0.0, 1.0, 0.0};
  double *e = malloc(n * sizeof *e);
  supine_solution found[3] = {{0}};
  for (int i = 0; i < 3; ++i) {
    const supine_expandability_law law = {SUPINE_EXPANDABILITY_LINEAR, 2, i == 0 ? 1.0 : 0.5 * i,
                                          i == 0 ? 1.0 : 1.5 * i};
    supine_model model = supine_physics_model(SUPINE_LAW_PAPER);
    model.stiffness = e;
    supine_tissue_expandability_regional(&lungs, &law, e);
    for (size_t v = 0; v < n; ++v) {
      e[v] = 1.0 / e[v];
    }
    assert_int_equal(supine_physics_solve(&lungs, &model, g, &found[i], NULL), SUPINE_OK);
  }
  /* mean ratio of a displacement to that in a uniform lung, near the apex and near the base */
  double ends[2] = {0.0, 0.0};
  double count[2] = {0.0, 0.0};
  for (size_t i = 0; i < n; ++i) {
    double box[3];
    supine_lungs_box_coordinates(&lungs, i, box);
    assert_true(fabs(found[1].catch_[i] - found[2].catch_[i]) <= 1e-12);
    if (found[0].catch_[i] > 0.01 && (box[2] < 0.2 || box[2] > 0.8)) {
      ends[box[2] > 0.5] += found[1].catch_[i] / found[0].catch_[i];
      count[box[2] > 0.5] += 1.0;
    }
  }
  assert_true(ends[0] / count[0] < 0.8);
  assert_true(ends[1] / count[1] > 1.2);
  for (int i = 0; i < 3; ++i) {
    supine_physics_solution_free(&found[i]);
  }
  free(e);
}

TEST_GROUP(setup, teardown)
