/* SPDX-License-Identifier: GPL-3.0-or-later */
/* '--law cohort': of people whom it has not seen it leaves less than 'deep' does, and it is what
 * all of them together make of it. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include <cmocka.h>
#include <gsl/gsl_errno.h>

#include "tests/cohort.h"

static void test_law_of_others_leaves_less_than_deep(void **state) {
  (void)state;
  cohort_person people[COHORT];
  if (!cohort_load(people)) {
    skip();
  }
  const supine_patient_power deep = cohort_of_law(SUPINE_LAW_DEEP);
  double mean[2] = {0.0, 0.0};
  size_t better = 0;
  for (size_t p = 0; p < COHORT; ++p) {
    const supine_patient_power others = cohort_fit(people, p, &cohort_physical);
    const double left[2] = {cohort_left(&people[p], &deep), cohort_left(&people[p], &others)};
    printf("%s: deep leaves %.2f mm, the law of the others %.2f\n", people[p].name, left[0],
           left[1]);
    mean[0] += left[0] / COHORT;
    mean[1] += left[1] / COHORT;
    better += left[1] < left[0];
  }
  printf("mean: %.2f and %.2f mm\n", mean[0], mean[1]);
  assert_true(better >= 4);
  assert_true(mean[1] < 0.97 * mean[0]); /* 7.99 of 8.32 mm: 4 % less */
  assert_true(mean[0] > 8.0);            /* the motion itself, so that nothing was made small */
  cohort_free(people);
}

static void test_preset_is_the_law_of_all(void **state) {
  (void)state;
  cohort_person people[COHORT];
  if (!cohort_load(people)) {
    skip();
  }
  const supine_patient_power all = cohort_fit(people, COHORT, &cohort_physical);
  const supine_model found = cohort_model(&all);
  const supine_model preset = supine_physics_model(SUPINE_LAW_COHORT);
  for (size_t k = 0; k < 6; ++k) { /* to the digits given */
    assert_true(fabs(preset.direction.c[k] - found.direction.c[k]) < (k % 2 == 0 ? 0.05 : 0.01));
  }
  for (size_t k = 0; k < 3; ++k) {
    assert_true(fabs(preset.force.box[k] - found.force.box[k]) < 0.01);
  }
  assert_true(fabs(preset.force.base - found.force.base) < 0.01);
  assert_true(preset.force.gain == found.force.gain && preset.reach == found.reach);
  cohort_free(people);
}

int main(void) {
  static const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_law_of_others_leaves_less_than_deep),
      cmocka_unit_test(test_preset_is_the_law_of_all)};
  (void)gsl_set_error_handler_off();
  return cmocka_run_group_tests(tests, NULL, NULL);
}
