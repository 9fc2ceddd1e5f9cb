/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test the quadrature rule: tabulated nodes, exactness, directions, refused arguments. */
#include <float.h>

#include "sh/expansion.h"
#include "tests/helpers/test.h"

/* The nodes and weights are those of M. Abramowitz and I. A. Stegun, Handbook of Mathematical
 * Functions, table 25.4, n = 5. */
TEST(test_grid_five_latitudes_match_table) {
  static const double z[] = {0.906179845938664, 0.538469310105683, 0, -0.538469310105683,
                             -0.906179845938664};
  static const double w[] = {0.236926885056189, 0.478628670499366, 0.568888888888889,
                             0.478628670499366, 0.236926885056189};
  supine_sh_grid *grid = NULL;
  assert_int_equal(supine_sh_grid_create(5, 3, &grid), SUPINE_OK);
  assert_int_equal(grid->latitudes, 5);
  assert_int_equal(grid->longitudes, 3);
  for (size_t j = 0; j < 5; ++j) {
    assert_close(grid->z[j], z[j], 1e-15);
    assert_close(grid->weight[j], w[j], 1e-15);
  }
  supine_sh_grid_destroy(grid);
}

/* n latitudes integrate z^p exactly for p < 2 n. GSL has tables of nodes for some n and computes
 * them for others. */
TEST(test_grid_any_size_integrates_powers) {
  static const size_t sizes[] = {1, 2, 7, 16, 17, 20, 21, 31, 33, 63, 65, 127, 130};
  for (size_t s = 0; s < sizeof sizes / sizeof *sizes; ++s) {
    const size_t n = sizes[s];
    supine_sh_grid *grid = NULL;
    assert_int_equal(supine_sh_grid_create(n, 1, &grid), SUPINE_OK);
    for (size_t p = 0; p < 2 * n; ++p) {
      double sum = 0;
      for (size_t j = 0; j < n; ++j) {
        sum += grid->weight[j] * pow(grid->z[j], (double)p);
      }
      assert_close(sum, p % 2 == 0 ? 2 / (double)(p + 1) : 0, 32 * DBL_EPSILON);
    }
    for (size_t j = 1; j < n; ++j) {
      assert_true(grid->z[j] < grid->z[j - 1]);
    }
    supine_sh_grid_destroy(grid);
  }
}

TEST(test_grid_direction_unit_and_in_order) {
  supine_sh_grid *grid = NULL;
  assert_int_equal(supine_sh_grid_create(6, 8, &grid), SUPINE_OK);
  for (size_t j = 0; j < 6; ++j) {
    for (size_t k = 0; k < 8; ++k) {
      double d[3];
      supine_sh_grid_direction(grid, j, k, d);
      assert_true(d[2] == grid->z[j]);
      assert_close(d[0] * d[0] + d[1] * d[1] + d[2] * d[2], 1, 4 * DBL_EPSILON);
      const double turn = atan2(d[1], d[0]) / (2 * M_PI) * 8;
      assert_close(turn < -0.5 ? turn + 8 : turn, (double)k, 16 * DBL_EPSILON);
    }
  }
  supine_sh_grid_destroy(grid);
}

TEST(test_grid_bad_size_refused) {
  supine_sh_grid *grid = NULL;
  assert_int_equal(supine_sh_grid_create(0, 4, &grid), SUPINE_ERROR_ARGUMENT);
  assert_int_equal(supine_sh_grid_create(4, 0, &grid), SUPINE_ERROR_ARGUMENT);
  assert_int_equal(supine_sh_grid_create(SIZE_MAX, 4, &grid), SUPINE_ERROR_ARGUMENT);
  assert_int_equal(supine_sh_grid_create(4, SUPINE_SH_GRID_MAX + 1, &grid), SUPINE_ERROR_ARGUMENT);
  assert_null(grid);
  supine_sh_grid_destroy(NULL);
}
