/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Whether constants of a few people say more of another than '--law deep' does: each of the five
 * public pairs of breath-holds is left out in turn, one law (c1 to c9) is fitted to the other four,
 * a scale and a translation to each of them, and it is judged on the one left out, from inhaled to
 * exhaled, where a scale and a translation are all that is fitted.
 *
 *     bench_cohort */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "precompute/patient/fit.h"
#include "precompute/physics/model.h"

enum { PAIRS = 5, ROUNDS = 60, STEPS = 40 };

typedef struct person {
  const char *name;
  supine_patient_pairs pairs;
  supine_patient_row *rows; /* [3 count] */
  double scale, shift[3];   /* of a law, as fitted last */
} person;

static void need(supine_status status, const supine_error *error) {
  if (status != SUPINE_OK) {
    (void)fprintf(stderr, "%s\n", error->message);
    exit(EXIT_FAILURE);
  }
}

/* What the law moves a row's point by along the row's axis, mm. */
static double moved(const supine_patient_power *law, const supine_patient_row *row) {
  supine_patient_row still = *row;
  still.value = 0.0;
  return supine_patient_power_residual(law, &still);
}

/* Scale and translation by least squares; mm RMS left. */
static double adapt(person *p, const supine_patient_power *law) {
  const double n = (double)p->pairs.count;
  double v[3] = {0.0};
  double y[3] = {0.0};
  double vv = 0.0;
  double vy = 0.0;
  double left = 0.0;
  for (size_t i = 0; i < 3 * p->pairs.count; ++i) {
    const double u = moved(law, &p->rows[i]);
    v[i % 3] += u / n;
    y[i % 3] += p->rows[i].value / n;
    vv += u * u;
    vy += u * p->rows[i].value;
  }
  for (int k = 0; k < 3; ++k) {
    vv -= n * v[k] * v[k];
    vy -= n * v[k] * y[k];
  }
  p->scale = vv > 0.0 ? vy / vv : 0.0;
  for (int k = 0; k < 3; ++k) {
    p->shift[k] = y[k] - p->scale * v[k];
  }
  for (size_t i = 0; i < 3 * p->pairs.count; ++i) {
    left += pow(p->scale * moved(law, &p->rows[i]) + p->shift[i % 3] - p->rows[i].value, 2.0);
  }
  return sqrt(left / n);
}

/* One law for all people but one: law and adaptations by turns. */
static supine_patient_power fit_all_but(person *people, size_t without) {
  supine_patient_power law = {.powers = {2.6, 1.0, 1.3, 0.0, -0.6, 0.0}, .linear = {6, 15, 16}};
  size_t count = 0;
  for (size_t p = 0; p < PAIRS; ++p) {
    count += 3 * people[p].pairs.count;
  }
  supine_patient_row *rows = malloc(count * sizeof *rows);
  if (rows == NULL) {
    exit(EXIT_FAILURE);
  }
  for (int round = 0; round < ROUNDS; ++round) {
    supine_error error;
    count = 0;
    for (size_t p = 0; p < PAIRS; ++p) {
      if (p == without) {
        continue;
      }
      (void)adapt(&people[p], &law);
      for (size_t i = 0; i < 3 * people[p].pairs.count; ++i) {
        supine_patient_row row = people[p].rows[i];
        row.value = (row.value - people[p].shift[i % 3]) / people[p].scale;
        row.weight = people[p].scale * people[p].scale / (double)people[p].pairs.count;
        rows[count++] = row;
      }
    }
    need(supine_patient_power_fit(rows, count, SUPINE_PATIENT_STILL, law.powers, STEPS, 1e-8, &law,
                                  &error),
         &error);
  }
  free(rows);
  return law;
}

static supine_patient_power of_model(supine_law name) {
  const supine_model model = supine_physics_model(name);
  const double *c = model.direction.c;
  const double *f = model.force.box;
  /* Supine, the height is 1 - Y; 1 at the centre. */
  const double centre = model.force.base + 0.5 * model.force.gain + 0.5 * (f[0] + f[1] + f[2]);
  return (supine_patient_power){.powers = {c[1], c[3], c[5], f[0] / centre,
                                           (f[1] - model.force.gain) / centre, f[2] / centre},
                                .linear = {c[0], c[2], c[4]}};
}

int main(void) {
  static const char *const cases[PAIRS] = {"054", "055", "056", "094", "097"};
  static const supine_patient_power still = {.powers = {1.0, 1.0, 1.0}};
  person people[PAIRS] = {{0}};
  supine_error error;
  const supine_patient_power deep = of_model(SUPINE_LAW_DEEP);
  const supine_patient_power tidal = of_model(SUPINE_LAW_TIDAL);
  double mean[5] = {0.0};
  size_t better = 0;
  for (size_t p = 0; p < PAIRS; ++p) {
    char path[512];
    (void)snprintf(path, sizeof path, "%s/landmarks/case%s_landmarks_mm.csv", SUPINE_TEST_DATA,
                   cases[p]);
    people[p].name = cases[p];
    need(supine_patient_pairs_load(path, true, &people[p].pairs, &error), &error);
    people[p].rows = malloc(3 * people[p].pairs.count * sizeof *people[p].rows);
    const supine_patient_frame frame =
        supine_patient_frame_of_points(people[p].pairs.count, people[p].pairs.from, NULL);
    supine_patient_rows_of_pairs(&frame, &people[p].pairs, people[p].rows);
  }
  (void)printf("mm RMS left, from inhaled to exhaled, a scale and a translation fitted\n"
               "case  translation   tidal    deep   left out    the law of the other four\n");
  for (size_t p = 0; p < PAIRS; ++p) {
    const supine_patient_power law = fit_all_but(people, p);
    const double left[4] = {adapt(&people[p], &still), adapt(&people[p], &tidal),
                            adapt(&people[p], &deep), adapt(&people[p], &law)};
    const double *c = law.linear;
    const double *q = law.powers;
    (void)printf("%s   %11.2f %7.2f %7.2f %10.2f    c %.1f %.2f %.1f %.2f %.1f %.2f, force %.2f "
                 "%.2f %.2f\n",
                 people[p].name, left[0], left[1], left[2], left[3], 16.0 * c[0] / c[2], q[0],
                 16.0 * c[1] / c[2], q[1], 16.0, q[2], q[3], q[4], q[5]);
    for (int k = 0; k < 4; ++k) {
      mean[k] += left[k] / PAIRS;
    }
    better += left[3] < left[2];
  }
  (void)printf("mean  %11.2f %7.2f %7.2f %10.2f\n"
               "left out better than deep in %zu of %d\n",
               mean[0], mean[1], mean[2], mean[3], better, PAIRS);
  for (size_t p = 0; p < PAIRS; ++p) {
    supine_patient_pairs_free(&people[p].pairs);
    free(people[p].rows);
  }
  return EXIT_SUCCESS;
}
