/* SPDX-License-Identifier: GPL-3.0-or-later */
/* One law for several people: the five public pairs of breath-holds, from inhaled to exhaled, where
 * a scale and a translation are all that is fitted to each. What '--law cohort' was found by. */
#ifndef SUPINE_TEST_COHORT_H
#define SUPINE_TEST_COHORT_H

#include "precompute/patient/fit.h"
#include "precompute/physics/model.h"

enum { COHORT = 5 };

typedef struct cohort_person {
  const char *name;
  supine_patient_pairs pairs;
  supine_patient_row *rows; /* [3 count] */
} cohort_person;

/* Ranges of c2, c4, c6, c7, c8, c9. */
typedef struct cohort_ranges {
  double low[SUPINE_PATIENT_POWERS], high[SUPINE_PATIENT_POWERS];
} cohort_ranges;

/* As wide as 'supine fit' has them. */
extern const cohort_ranges cohort_wide;

/* Those within which real pairs at rest (postures.h), which no landmark is taken from, turn next to
 * no triangles over and fill from apex to base no less evenly than 'deep' has it: c4 below 0.8 and
 * c7 above 0.1 fold the back and the flanks, c6 above 1.15 and c9 above 0 empty the upright base.
 */
extern const cohort_ranges cohort_physical;

/* False where the landmarks are not there. */
bool cohort_load(cohort_person people[COHORT]);
void cohort_free(cohort_person people[COHORT]);

/* mm RMS that a law leaves of a person's points, after a scale and a translation. */
double cohort_left(const cohort_person *person, const supine_patient_power *law);

/* The law that leaves least of all people's points but those of `without` (COHORT: of all), each
 * person counting the same; c5 is 16 mm. */
supine_patient_power cohort_fit(const cohort_person *people, size_t without,
                                const cohort_ranges *ranges);

/* A law by name as it is supine, and such a law with the share of its gradient that turns with
 * gravity, 0.4 of a mean of 1. */
supine_patient_power cohort_of_law(supine_law name);
supine_model cohort_model(const supine_patient_power *law);

#endif
