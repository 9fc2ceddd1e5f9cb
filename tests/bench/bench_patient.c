/* SPDX-License-Identifier: GPL-3.0-or-later */
/* What fitting a patient costs: 300 landmarks; the law, and its expandability, of 20,001 vertices;
 * and how often the stated intervals hold the truth. Seconds on the clock and of the processor.
 *
 *     bench_patient */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include <gsl/gsl_errno.h>
#include <gsl/gsl_randist.h>
#include <gsl/gsl_rng.h>

#include "precompute/patient/surfaces.h"
#include "precompute/lungs/phantom.h"
#include "precompute/physics/solve.h"
#include "precompute/lungs/disease.h"
#include "sh/base/clock.h"

enum { LANDMARKS = 300, REPEATS = 3, SEEDS = 20, VERTICES = 20001, FINE = 40000 };

static void need(supine_status status, const supine_error *error) {
  if (status != SUPINE_OK) {
    (void)fprintf(stderr, "%s: %s\n", supine_status_string(status), error->message);
    exit(EXIT_FAILURE);
  }
}

static double processor_seconds(void) {
  struct timespec now;
  (void)clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* Landmarks over two lungs under a known law, 0.5 mm of noise. */
static void scatter(unsigned long seed, const supine_patient *truth, supine_patient_pairs *pairs) {
  gsl_rng *random = gsl_rng_alloc(gsl_rng_mt19937);
  gsl_rng_set(random, seed);
  for (size_t i = 0; i < pairs->count; ++i) {
    double *p = pairs->from + 3 * i;
    double u[3];
    p[0] = (i % 2 == 0 ? 1.0 : -1.0) * (17.3 + 97.1 * gsl_rng_uniform(random));
    p[1] = -151.7 + 149.3 * gsl_rng_uniform(random);
    p[2] = -203.1 + 241.9 * gsl_rng_uniform(random);
    supine_patient_displacement(truth, p, 0.0, u);
    for (size_t k = 0; k < 3; ++k) {
      pairs->to[3 * i + k] = p[k] + u[k] + gsl_ran_gaussian(random, 0.5);
    }
  }
  gsl_rng_free(random);
}

static void landmarks(void) {
  const supine_patient truth = {.law = SUPINE_PATIENT_PAPER,
                                .frame = {{-125.0, -162.0, -214.0}, {125.0, 8.0, 49.0}, 0.0, 0},
                                .powers = {2.1, 1.3, 1.6, 0.2, -0.7, 0.3},
                                .lengths = {7.3, 5.9, 21.7}};
  const supine_patient_fit_options options = {.law = SUPINE_PATIENT_PAPER};
  supine_patient_pairs pairs = {LANDMARKS, malloc(3 * LANDMARKS * sizeof(double)),
                                malloc(3 * LANDMARKS * sizeof(double)), NULL};
  supine_patient_row *rows = malloc(3 * LANDMARKS * sizeof *rows);
  double expected[SUPINE_PATIENT_CONSTANTS];
  size_t within[2] = {0}; /* the intervals, three standard errors */
  double seconds[2] = {INFINITY, INFINITY};
  if (pairs.from == NULL || pairs.to == NULL || rows == NULL) {
    exit(EXIT_FAILURE);
  }
  supine_patient_constants(&truth, expected);
  for (unsigned long seed = 1; seed <= SEEDS; ++seed) {
    supine_patient patient;
    supine_patient_fit_report report;
    supine_error error = {0};
    double c[SUPINE_PATIENT_CONSTANTS];
    scatter(seed, &truth, &pairs);
    const double wall = supine_clock_seconds();
    const double begin = processor_seconds();
    supine_patient_rows_of_pairs(&truth.frame, &pairs, rows);
    need(supine_patient_fit(&truth.frame, rows, 0, LANDMARKS, &options, &patient, &report, &error),
         &error);
    seconds[0] = fmin(seconds[0], supine_clock_seconds() - wall);
    seconds[1] = fmin(seconds[1], processor_seconds() - begin);
    supine_patient_constants(&patient, c);
    for (size_t k = 0; k < SUPINE_PATIENT_CONSTANTS; ++k) {
      within[0] += expected[k] >= report.low[k] && expected[k] <= report.high[k];
      within[1] += fabs(c[k] - expected[k]) <= 3.0 * report.error[k];
    }
  }
  (void)printf("%d landmarks: %.2f s, %.2f s of the processor (the least of %d)\n"
               "of c1 to c9 over %d seeds of noise, %.0f %% lie in their 95 %% intervals, %.0f %% "
               "within three standard errors\n",
               LANDMARKS, seconds[0], seconds[1], SEEDS, SEEDS,
               100.0 * (double)within[0] / (SEEDS * SUPINE_PATIENT_CONSTANTS),
               100.0 * (double)within[1] / (SEEDS * SUPINE_PATIENT_CONSTANTS));
  supine_patient_pairs_free(&pairs);
  free(rows);
}

static void made(size_t vertices, supine_lungs *lungs) {
  supine_mesh mesh = {0};
  supine_error error = {0};
  need(supine_phantom_create(vertices, 6000.0, &mesh, &error), &error);
  need(supine_lungs_create(&mesh, 1, NULL, lungs, &error), &error);
  supine_mesh_free(&mesh);
}

/* In place: moved by a known law with a lesion, 0.5 mm of noise. */
static void move(supine_lungs *lungs, supine_model model, const supine_lesion *lesion) {
  static const double supine[3] = {0.0, 1.0, 0.0};
  const size_t n = lungs->mesh.vertex_count;
  supine_solution solution = {0};
  supine_error error = {0};
  double *e = malloc(n * sizeof *e);
  gsl_rng *random = gsl_rng_alloc(gsl_rng_mt19937);
  for (size_t i = 0; i < n; ++i) {
    e[i] = 1.0;
  }
  need(supine_tissue_add_lesion(lungs, lesion, e, NULL, &error), &error);
  model.stiffness = e;
  need(supine_physics_solve(lungs, &model, supine, &solution, &error), &error);
  supine_physics_solution_apply(&solution, &lungs->mesh, 1.0, lungs->mesh.vertices);
  for (size_t i = 0; i < 3 * n; ++i) {
    lungs->mesh.vertices[i] += gsl_ran_gaussian(random, 0.5);
  }
  gsl_rng_free(random);
  supine_physics_solution_free(&solution);
  free(e);
}

static void surfaces(void) {
  static const supine_lesion lesion = {{-108.0, -139.0, -195.0}, 64.0, 3.0};
  supine_model model = supine_physics_model(SUPINE_LAW_PAPER);
  supine_lungs rest = {0};
  supine_lungs state = {0};
  model.reach = 10.0;
  model.force = (supine_force_law){.base = 0.9, .gain = 0.4, .box = {0.0, -0.2, 0.0}};
  model.direction =
      (supine_direction_law){.model = SUPINE_DIRECTION_BOX, .c = {6.0, 2.6, 15.0, 1.0, 26.0, 1.3}};
  made(VERTICES, &rest);
  made(FINE, &state);
  move(&state, model, &lesion);
  for (int with = 0; with < 2; ++with) {
    double seconds[2] = {INFINITY, INFINITY};
    supine_patient_surface_fit fit;
    for (int k = 0; k < (with == 1 ? 1 : REPEATS); ++k) {
      const supine_patient_surface_task task = {.rest = &rest,
                                                .state = &state.mesh,
                                                .model = &model,
                                                .gravity = {0.0, 1.0, 0.0},
                                                .expandability = with == 1};
      supine_error error = {0};
      const double wall = supine_clock_seconds();
      const double begin = processor_seconds();
      need(supine_patient_fit_surface(&task, &fit, &error), &error);
      seconds[0] = fmin(seconds[0], supine_clock_seconds() - wall);
      seconds[1] = fmin(seconds[1], processor_seconds() - begin);
    }
    (void)printf("%s of %zu vertices: %.1f s, %.1f s of the processor\n",
                 with == 1 ? "law and expandability" : "law", rest.mesh.vertex_count, seconds[0],
                 seconds[1]);
    if (with == 1) {
      (void)printf("  held out %.2f mm with, %.2f without; stiffness %.2f to %.2f, the truth 1 to "
                   "3\n",
                   fit.expand.held_out[1], fit.expand.held_out[0], fit.expand.softest,
                   fit.expand.stiffest);
    }
  }
  supine_lungs_free(&rest);
  supine_lungs_free(&state);
}

int main(void) {
  (void)gsl_set_error_handler_off();
  landmarks();
  surfaces();
  return EXIT_SUCCESS;
}
