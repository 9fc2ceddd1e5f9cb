/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The equilibrium solve: conjugate gradients against successive over-relaxation to the same
 * residual, and full solves a second of the sampled route, from 5 to 80 thousand vertices. One
 * thread for the comparison, which is interleaved and keeps the least of each; all for the sampled
 * route.
 *
 *     bench_solve [REPEATS] */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "precompute/phantom/phantom.h"
#include "precompute/projection/projection.h"
#include "sh/base/clock.h"
#include "sh/base/parallel.h"

#include "precompute/physics/equilibrium_internal.h"

enum { RHS = 4 };

static const double tolerance = 1e-14;

/* Seconds of one iteration from zero, on the system that the last solve left. */
static double iterate(supine_equilibrium *eq, const double *norm, bool relaxation,
                      supine_solve_report *report) {
  supine_pass *work = calloc(1, sizeof *work);
  if (work == NULL) {
    exit(EXIT_FAILURE);
  }
  work->eq = eq;
  work->wanted = tolerance;
  memcpy(work->norm, norm, sizeof work->norm);
  memset(eq->solution, 0, eq->network->vertex_count * eq->count * sizeof(double));
  *report = (supine_solve_report){0, INFINITY};
  const double begin = supine_clock_seconds();
  if (relaxation) {
    supine_physics_relaxation(work, report);
  } else if (supine_physics_conjugate_gradients(work, 200, report) != SUPINE_OK) {
    exit(EXIT_FAILURE);
  }
  const double seconds = supine_clock_seconds() - begin;
  free(work);
  if (!(report->residual <= tolerance)) {
    (void)fprintf(stderr, "did not converge\n");
    exit(EXIT_FAILURE);
  }
  return seconds;
}

static void compare(const supine_lungs *lungs, size_t count, int repeats) {
  const size_t n = lungs->mesh.vertex_count;
  supine_network *network = NULL;
  supine_equilibrium *eq = NULL;
  supine_solve_report report[2] = {{0}};
  double norm[SUPINE_RHS_MAX] = {0.0};
  double least[2] = {INFINITY, INFINITY};
  double *force = malloc(RHS * n * sizeof *force);
  double *caught = malloc(RHS * n * sizeof *caught);
  const supine_force_law law = supine_physics_force_law_default();
  if (force == NULL || caught == NULL ||
      supine_physics_network_create(&lungs->mesh, &lungs->topology, &network) != SUPINE_OK ||
      supine_physics_equilibrium_create(network, count, 1, &eq) != SUPINE_OK ||
      supine_physics_equilibrium_set_stiffness(eq, NULL, NULL) != SUPINE_OK) {
    exit(EXIT_FAILURE);
  }
  supine_physics_force_columns(lungs, &law, force); /* read as n x count: any forces will do */
  if (supine_physics_equilibrium_solve(eq, count, force, tolerance, false, caught, NULL, NULL) !=
      SUPINE_OK) {
    exit(EXIT_FAILURE);
  }
  for (size_t i = 0; i < n * count; ++i) {
    norm[i % count] += eq->right[i] * eq->right[i];
  }
  for (int repeat = 0; repeat < repeats; ++repeat) {
    for (int k = 0; k < 2; ++k) {
      least[k] = fmin(least[k], iterate(eq, norm, k == 1, &report[k]));
    }
  }
  (void)printf("%8zu  %3zu  %3zu steps %8.2f ms   %3zu sweeps %8.2f ms   %5.2f\n", n, count,
               report[0].iterations, 1e3 * least[0], report[1].iterations, 1e3 * least[1],
               least[1] / least[0]);
  supine_physics_equilibrium_destroy(eq);
  supine_physics_network_destroy(network);
  free(force);
  free(caught);
}

static void sample(const supine_lungs *lungs) {
  enum { BAND = 7 };
  supine_model model = supine_physics_model_default();
  supine_projection projection = {0};
  supine_error error;
  model.force.soften = 1.0;
  const double begin = supine_clock_seconds();
  if (supine_projection_sampled(lungs, &model, BAND, 0.0, NULL, NULL, &projection, &error) !=
      SUPINE_OK) {
    (void)fprintf(stderr, "%s\n", error.message);
    exit(EXIT_FAILURE);
  }
  const double seconds = supine_clock_seconds() - begin;
  (void)printf("%8zu  %8.1f solves a second   %6.1f ns a vertex and solve   at most %zu steps\n",
               lungs->mesh.vertex_count, (double)projection.solve_count / seconds,
               1e9 * seconds / (double)(projection.solve_count * lungs->mesh.vertex_count),
               projection.iterations);
  supine_projection_free(&projection);
}

int main(int argc, char **argv) {
  static const size_t sizes[] = {5000, 10000, 20000, 40000, 80000};
  enum { SIZES = sizeof sizes / sizeof *sizes };
  const int repeats = argc > 1 ? (int)strtol(argv[1], NULL, 10) : 7;
  supine_lungs lungs[SIZES] = {0};
  for (size_t s = 0; s < SIZES; ++s) {
    supine_mesh mesh = {0};
    if (supine_phantom_create(sizes[s], 2500.0, &mesh, NULL) != SUPINE_OK ||
        supine_lungs_create(&mesh, 1, NULL, &lungs[s], NULL) != SUPINE_OK) {
      return EXIT_FAILURE;
    }
    supine_mesh_free(&mesh);
  }
  (void)printf("to a relative residual of %.0e, one thread\n"
               "vertices  rhs  conjugate gradients     over-relaxation          ratio\n",
               tolerance);
  for (size_t s = 0; s < SIZES; ++s) {
    compare(&lungs[s], 1, repeats);
    compare(&lungs[s], RHS, repeats);
  }
  (void)printf("\nsampled route, soften 1, %zu threads, warm starts, transform included\n",
               supine_thread_count());
  for (size_t s = 0; s < SIZES; ++s) {
    sample(&lungs[s]);
    supine_lungs_free(&lungs[s]);
  }
  return EXIT_SUCCESS;
}
