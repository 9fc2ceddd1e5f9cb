/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "tests/cohort.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <gsl/gsl_multifit_nlinear.h>

enum { POWERS = SUPINE_PATIENT_POWERS, UNKNOWNS = POWERS + 2, STEPS = 200 };

static const double diaphragm = 16.0; /* c5, mm: a scale is fitted to each, so that one is free */
static const double turning = 0.4;    /* of the force, as 'deep' has it (model.h) */
static const double longest = 32.0;   /* c1 and c3, mm: twice c5 */

const cohort_ranges cohort_wide = {{0.5, 0.5, 0.5, -1.2, -1.2, -1.2},
                                   {4.0, 4.0, 4.0, 1.2, 1.2, 1.2}};
const cohort_ranges cohort_physical = {{1.0, 0.8, 0.9, -1.2, -1.2, -1.2},
                                       {3.0, 3.0, 1.15, 0.1, 1.2, 0.0}};

bool cohort_load(cohort_person people[COHORT]) {
  static const char *const cases[COHORT] = {"054", "055", "056", "094", "097"};
  memset(people, 0, COHORT * sizeof *people);
  for (size_t p = 0; p < COHORT; ++p) {
    char path[512];
    supine_error error;
    supine_patient_pairs *pairs = &people[p].pairs;
    (void)snprintf(path, sizeof path, "%s/landmarks/case%s_landmarks_mm.csv", SUPINE_TEST_DATA,
                   cases[p]);
    if (access(path, R_OK) != 0) {
      printf("the landmarks are not there: %s\n", path);
      return false;
    }
    people[p].name = cases[p];
    if (supine_patient_pairs_load(path, true, pairs, &error) != SUPINE_OK ||
        (people[p].rows = malloc(3 * pairs->count * sizeof *people[p].rows)) == NULL) {
      printf("%s\n", error.message);
      abort();
    }
    const supine_patient_frame frame =
        supine_patient_frame_of_points(pairs->count, pairs->from, NULL);
    supine_patient_rows_of_pairs(&frame, pairs, people[p].rows);
  }
  return true;
}

void cohort_free(cohort_person people[COHORT]) {
  for (size_t p = 0; p < COHORT; ++p) {
    supine_patient_pairs_free(&people[p].pairs);
    free(people[p].rows);
  }
}

/* What a law leaves of each row, mm, after the scale and the translation that leave least; [3
 * count] */
static void leave(const cohort_person *person, const supine_patient_power *law, double *left) {
  const size_t count = 3 * person->pairs.count;
  const double n = (double)person->pairs.count;
  double u_mean[3] = {0.0};
  double y_mean[3] = {0.0};
  double uu = 0.0;
  double uy = 0.0;
  for (size_t i = 0; i < count; ++i) {
    left[i] = supine_patient_power_residual(law, &person->rows[i]) + person->rows[i].value;
    u_mean[i % 3] += left[i] / n;
    y_mean[i % 3] += person->rows[i].value / n;
  }
  for (size_t i = 0; i < count; ++i) {
    left[i] -= u_mean[i % 3];
    uu += left[i] * left[i];
    uy += left[i] * (person->rows[i].value - y_mean[i % 3]);
  }
  const double scale = uu > 0.0 ? uy / uu : 0.0;
  for (size_t i = 0; i < count; ++i) {
    left[i] = scale * left[i] - (person->rows[i].value - y_mean[i % 3]);
  }
}

double cohort_left(const cohort_person *person, const supine_patient_power *law) {
  double *left = malloc(3 * person->pairs.count * sizeof *left);
  double sum = 0.0;
  if (left == NULL) {
    abort();
  }
  leave(person, law, left);
  for (size_t i = 0; i < 3 * person->pairs.count; ++i) {
    sum += left[i] * left[i];
  }
  free(left);
  return sqrt(sum / (double)person->pairs.count);
}

typedef struct problem {
  const cohort_person *people;
  size_t without;
  double *left;                         /* room for one person's rows */
  double low[UNKNOWNS], high[UNKNOWNS]; /* of c2, c4, c6 to c9, c1, c3 */
} problem;

/* Within the ranges, from variables without bounds. */
static supine_patient_power law_of(const problem *p, const gsl_vector *q) {
  double x[UNKNOWNS];
  supine_patient_power law = {.linear = {0.0, 0.0, diaphragm}};
  for (size_t k = 0; k < UNKNOWNS; ++k) {
    x[k] = p->low[k] + (p->high[k] - p->low[k]) * 0.5 * (1.0 + sin(gsl_vector_get(q, k)));
  }
  memcpy(law.powers, x, sizeof law.powers);
  memcpy(law.linear, x + POWERS, 2 * sizeof *x);
  return law;
}

static int residuals(const gsl_vector *q, void *context, gsl_vector *all) {
  const problem *p = context;
  const supine_patient_power law = law_of(p, q);
  size_t begin = 0;
  for (size_t k = 0; k < COHORT; ++k) {
    const size_t count = 3 * p->people[k].pairs.count;
    if (k == p->without) {
      continue;
    }
    leave(&p->people[k], &law, p->left);
    for (size_t i = 0; i < count; ++i) {
      gsl_vector_set(all, begin++, p->left[i] / sqrt((double)p->people[k].pairs.count));
    }
  }
  return GSL_SUCCESS;
}

supine_patient_power cohort_fit(const cohort_person *people, size_t without,
                                const cohort_ranges *ranges) {
  gsl_multifit_nlinear_parameters settings = gsl_multifit_nlinear_default_parameters();
  gsl_multifit_nlinear_fdf system = {.f = residuals, .p = UNKNOWNS};
  problem p = {.people = people, .without = without};
  const supine_patient_power deep = cohort_of_law(SUPINE_LAW_DEEP);
  gsl_vector *q = gsl_vector_alloc(UNKNOWNS);
  int info = 0;
  size_t most = 0;
  system.params = &p;
  for (size_t k = 0; k < COHORT; ++k) {
    const size_t count = 3 * people[k].pairs.count;
    system.n += k == without ? 0 : count;
    most = count > most ? count : most;
  }
  p.left = malloc(most * sizeof *p.left);
  for (size_t k = 0; k < UNKNOWNS; ++k) {
    p.low[k] = k < POWERS ? ranges->low[k] : 0.0;
    p.high[k] = k < POWERS ? ranges->high[k] : longest;
    const double start = k < POWERS ? deep.powers[k] : deep.linear[k - POWERS];
    const double t = 2.0 * (start - p.low[k]) / (p.high[k] - p.low[k]) - 1.0;
    gsl_vector_set(q, k, asin(fmin(0.9, fmax(-0.9, t)))); /* away from where the sine is flat */
  }
  gsl_multifit_nlinear_workspace *work =
      gsl_multifit_nlinear_alloc(gsl_multifit_nlinear_trust, &settings, system.n, UNKNOWNS);
  if (p.left == NULL || q == NULL || work == NULL ||
      gsl_multifit_nlinear_init(q, &system, work) != GSL_SUCCESS) {
    abort();
  }
  /* At a bound steps no longer help: what counts is where it stands. */
  (void)gsl_multifit_nlinear_driver(STEPS, 1e-10, 1e-10, 0.0, NULL, NULL, &info, work);
  const supine_patient_power found = law_of(&p, gsl_multifit_nlinear_position(work));
  gsl_multifit_nlinear_free(work);
  gsl_vector_free(q);
  free(p.left);
  return found;
}

supine_patient_power cohort_of_law(supine_law name) {
  const supine_model model = supine_physics_model(name);
  const double *c = model.direction.c;
  const double *f = model.force.box;
  /* Supine, the height is 1 - Y; 1 at the centre. */
  const double centre = model.force.base + 0.5 * model.force.gain + 0.5 * (f[0] + f[1] + f[2]);
  return (supine_patient_power){.powers = {c[1], c[3], c[5], f[0] / centre,
                                           (f[1] - model.force.gain) / centre, f[2] / centre},
                                .linear = {c[0], c[2], c[4]}};
}

supine_model cohort_model(const supine_patient_power *law) {
  supine_model model = supine_physics_model(SUPINE_LAW_DEEP);
  const double *f = law->powers + 3;
  const double box[3] = {f[0], f[1] + turning, f[2]};
  const double c[6] = {law->linear[0], law->powers[0], law->linear[1],
                       law->powers[1], law->linear[2], law->powers[2]};
  model.force.gain = turning;
  model.force.base = 1.0 - 0.5 * (turning + box[0] + box[1] + box[2]);
  memcpy(model.force.box, box, sizeof box);
  memcpy(model.direction.c, c, sizeof c);
  return model;
}
