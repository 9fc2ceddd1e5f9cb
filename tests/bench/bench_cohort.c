/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Whether constants of a few people say more of another than '--law deep' does: each of the five
 * public pairs of breath-holds is left out in turn, one law (c1 to c9) is fitted to the other four,
 * and judged on the one left out. Then what such laws do to a real pair at rest, which is why
 * '--law cohort' has bounds.
 *
 *     bench_cohort */
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include <gsl/gsl_errno.h>

#include "precompute/precompute.h"

#include "tests/cohort.h"
#include "tests/postures.h"

static void need(bool good, const char *what) {
  if (!good) {
    (void)fprintf(stderr, "bench_cohort: %s\n", what);
    exit(EXIT_FAILURE);
  }
}

static void print_law(const supine_patient_power *law) {
  (void)printf("c %.2f %.2f %.2f %.2f %.2f %.2f, force %+.2f %+.2f %+.2f", law->linear[0],
               law->powers[0], law->linear[1], law->powers[1], law->linear[2], law->powers[2],
               law->powers[3], law->powers[4], law->powers[5]);
}

static void leave_one_out(const cohort_person *people, const char *what,
                          const cohort_ranges *ranges) {
  static const supine_patient_power still = {.powers = {1.0, 1.0, 1.0}};
  const supine_patient_power deep = cohort_of_law(SUPINE_LAW_DEEP);
  const supine_patient_power tidal = cohort_of_law(SUPINE_LAW_TIDAL);
  double mean[4] = {0.0};
  size_t better = 0;
  (void)printf("%s\ncase  translation   tidal    deep   left out    the law of the other four\n",
               what);
  for (size_t p = 0; p < COHORT; ++p) {
    const supine_patient_power law = cohort_fit(people, p, ranges);
    const double left[4] = {cohort_left(&people[p], &still), cohort_left(&people[p], &tidal),
                            cohort_left(&people[p], &deep), cohort_left(&people[p], &law)};
    (void)printf("%s   %11.2f %7.2f %7.2f %10.2f    ", people[p].name, left[0], left[1], left[2],
                 left[3]);
    print_law(&law);
    (void)putchar('\n');
    for (int k = 0; k < 4; ++k) {
      mean[k] += left[k] / COHORT;
    }
    better += left[3] < left[2];
  }
  (void)printf("mean  %11.2f %7.2f %7.2f %10.2f    better than deep in %zu of %d\n", mean[0],
               mean[1], mean[2], mean[3], better, COHORT);
}

static void at_rest(const char *name, const supine_model *model) {
  static const supine_scan full = {.kind = SUPINE_SCAN_FULL};
  static const char *const sides[2] = {"left", "right"};
  const supine_resting resting = supine_reference_resting_default();
  char path[512] = "/tmp/supine-cohort-XXXXXX";
  char file[512];
  supine_mesh meshes[2] = {{0}};
  supine_lungs lungs = {0};
  supine_reference reference;
  supine_precompute_options options = {
      .model = *model, .reference = &reference, .band = 23, .modes = 16, .held_out = 20};
  supine_precompute_report report;
  supine_basis *basis = NULL;
  posture_figures f[POSTURE_COUNT];
  supine_error error = {0};
  for (int side = 0; side < 2; ++side) {
    (void)snprintf(file, sizeof file, "%s/lungs/chaste_%s.ply", SUPINE_TEST_DATA, sides[side]);
    need(supine_mesh_load(file, NULL, &meshes[side], NULL, &error) == SUPINE_OK, error.message);
  }
  const int made = mkstemp(path);
  need(made >= 0 && close(made) == 0, "no file in /tmp");
  need(supine_lungs_create(meshes, 2, NULL, &lungs, &error) == SUPINE_OK &&
           supine_reference_find(&lungs, model, &full, &resting, &reference, &error) == SUPINE_OK &&
           supine_precompute(&lungs, &options, path, &report, &error) == SUPINE_OK &&
           supine_basis_open(path, &basis, &error) == SUPINE_OK &&
           postures_measure(basis, f, &error) == SUPINE_OK,
       error.message);
  (void)printf("%-16s", name);
  for (int p = 0; p < POSTURE_COUNT; ++p) {
    (void)printf("  %.4f %% %.2f", 100.0 * f[p].turned_over, f[p].dependent);
  }
  (void)printf("  %.1f, %.1f mm\n", f[1].move_mean, f[1].move_max);
  supine_basis_close(basis);
  supine_lungs_free(&lungs);
  supine_mesh_free(&meshes[0]);
  supine_mesh_free(&meshes[1]);
  (void)unlink(path);
}

int main(void) {
  cohort_person people[COHORT];
  (void)gsl_set_error_handler_off();
  need(cohort_load(people), "no landmarks");
  (void)puts("mm RMS left, from inhaled to exhaled, a scale and a translation fitted");
  leave_one_out(people, "\nwithin wide ranges:", &cohort_wide);
  leave_one_out(people,
                "\nwithin those in which lungs stay whole and fill evenly:", &cohort_physical);
  const supine_patient_power wide = cohort_fit(people, COHORT, &cohort_wide);
  const supine_patient_power physical = cohort_fit(people, COHORT, &cohort_physical);
  (void)printf("\nof all five, wide:   ");
  print_law(&wide);
  (void)printf("\nof all five, within: ");
  print_law(&physical);
  const supine_model models[] = {cohort_model(&wide), cohort_model(&physical),
                                 supine_physics_model(SUPINE_LAW_COHORT),
                                 supine_physics_model(SUPINE_LAW_DEEP)};
  (void)puts(
      "\n\na real pair at rest: triangles turned over; what a breath adds per volume, lowest "
      "quarter of height\nover uppermost; mean and largest move from supine to prone\n"
      "                  supine         prone          on the left    on the right   upright  "
      "      inverted");
  at_rest("wide", &models[0]);
  at_rest("within", &models[1]);
  at_rest("'--law cohort'", &models[2]);
  at_rest("'--law deep'", &models[3]);
  cohort_free(people);
  return EXIT_SUCCESS;
}
