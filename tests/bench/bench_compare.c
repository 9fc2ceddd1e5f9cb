/* SPDX-License-Identifier: GPL-3.0-or-later */
/* How long comparisons take: bench_compare BASIS, of any size. Prints what 'supine compare' of four
 * postures costs beyond opening the file, and ten thousand pairs through the Gram matrix against
 * passes over the vertices. */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#include "sh/base/clock.h"

#include "program/report/comparison.h"

enum { REPEATS = 5, PAIRS = 10000, PASSES = 20, DIRECTIONS = 200 };

/* Number in [-1, 1) (splitmix64). */
static double random_number(uint64_t *state) {
  uint64_t z = (*state += UINT64_C(0x9E3779B97F4A7C15));
  z = (z ^ (z >> 30)) * UINT64_C(0xBF58476D1CE4E5B9);
  z = (z ^ (z >> 27)) * UINT64_C(0x94D049BB133111EB);
  return (double)((z ^ (z >> 31)) >> 11) * 0x1p-52 - 1;
}

/* Ten thousand pairs of the same 200 directions: by the Gram matrix, and a few by the vertices. */
static int time_pairs(const supine_basis *basis, const supine_compare *compare, double *gram,
                      double *direct) {
  static supine_pose poses[DIRECTIONS];
  const size_t n = supine_basis_get_info(basis)->vertex_count;
  uint64_t state = 2008;
  float *distance = malloc(n * sizeof *distance);
  if (distance == NULL) {
    return 1;
  }
  const double start = supine_clock_seconds();
  for (int i = 0; i < DIRECTIONS; ++i) {
    const double g[3] = {random_number(&state), random_number(&state), 0.1 + random_number(&state)};
    const supine_state posture = {.gravity = {g[0], g[1], g[2]}};
    (void)supine_compare_pose(compare, &posture, 5, &poses[i], NULL);
  }
  double sum = 0;
  for (int pair = 0; pair < PAIRS; ++pair) {
    const int a = pair % DIRECTIONS;
    const int b = (7 * pair + pair / DIRECTIONS + 1) % DIRECTIONS;
    sum += supine_compare_rms(compare, &poses[a], &poses[b]);
  }
  *gram = supine_clock_seconds() - start;
  const double middle = supine_clock_seconds();
  for (int pair = 0; pair < PASSES; ++pair) {
    supine_distance_statistics statistics;
    supine_compare_distances(compare, &poses[pair], &poses[pair + 1], distance);
    supine_compare_statistics(compare, distance, &statistics);
    sum += statistics.rms;
  }
  *direct = (supine_clock_seconds() - middle) / PASSES;
  free(distance);
  return sum > 0 ? 0 : 1;
}

int main(int argc, char **argv) {
  supine_error error;
  double opening = 1e9;
  double comparing = 1e9;
  double gram = 1e9;
  double direct = 1e9;
  if (argc != 2) {
    (void)fputs("usage: bench_compare BASIS\n", stderr);
    return 1;
  }
  for (int repeat = 0; repeat < REPEATS; ++repeat) {
    supine_comparison comparison = {.path = argv[1], .state = {.gravity = {0, 1, 0}, .volume = {SUPINE_VOLUME_SCAN, 500}}};
    supine_basis *basis = NULL;
    const double start = supine_clock_seconds();
    if (supine_basis_open(argv[1], &basis, &error) != SUPINE_OK) {
      (void)fprintf(stderr, "%s\n", error.message);
      return 2;
    }
    const double opened = supine_clock_seconds();
    comparison.basis = basis;
    if (supine_options_posture_list_parse("compare", "supine,prone,left,right",
                                          &comparison.postures) != 0 ||
        supine_report_find(&comparison, &error) != SUPINE_OK) {
      (void)fprintf(stderr, "%s\n", error.message);
      return 2;
    }
    const double compared = supine_clock_seconds();
    double pairs = 0;
    double pass = 0;
    if (time_pairs(basis, comparison.compare, &pairs, &pass) != 0) {
      return 2;
    }
    opening = opened - start < opening ? opened - start : opening;
    comparing = compared - opened < comparing ? compared - opened : comparing;
    gram = pairs < gram ? pairs : gram;
    direct = pass < direct ? pass : direct;
    if (repeat == 0) {
      const supine_basis_info *info = supine_basis_get_info(basis);
      (void)printf("%zu vertices, %zu triangles, %zu modes of band %zu\n", info->vertex_count,
                   info->triangle_count, info->mode_count, info->band);
    }
    supine_report_free(&comparison);
    supine_basis_close(basis);
  }
  (void)printf("opening the file            %8.4f s\n"
               "comparing four postures     %8.4f s beyond opening it\n"
               "%d pairs, Gram matrix    %8.4f s (weights and scales of %d directions included)\n"
               "one pair, every vertex      %8.4f s: %.0f times one pair of the Gram matrix\n",
               opening, comparing, PAIRS, gram, DIRECTIONS, direct, direct / (gram / PAIRS));
  return 0;
}
