/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The equilibrium solve: steps and processor time a vertex of the linear route's right-hand sides,
 * with and without a reach, on made lungs of 10 thousand to 2 million vertices; and full solves a
 * second of the sampled route.
 *
 *     bench_solve [LARGEST [REPEATS]] */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "precompute/phantom/phantom.h"
#include "precompute/physics/equilibrium.h"
#include "precompute/projection/projection.h"
#include "sh/base/clock.h"
#include "sh/base/parallel.h"

static const double reach = 10.0; /* mm */

/* Of all threads: a machine shared with others makes the clock on the wall mean little. */
static double processor_seconds(void) {
  struct timespec now;
  (void)clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static void need(supine_status status, const supine_error *error) {
  if (status != SUPINE_OK) {
    (void)fprintf(stderr, "%s: %s\n", supine_status_string(status), error->message);
    exit(EXIT_FAILURE);
  }
}

/* Processor seconds to set up and to solve for the columns of the force. */
static void solve(const supine_lungs *lungs, double length, double seconds[2],
                  supine_solve_report *report) {
  const size_t n = lungs->mesh.vertex_count;
  supine_model model = supine_physics_model(SUPINE_LAW_PAPER);
  const size_t count = supine_physics_force_column_count(&model.force);
  supine_network *network = NULL;
  supine_equilibrium *equilibrium = NULL;
  supine_error error = {0};
  double *force = malloc(count * n * sizeof *force);
  double *caught = malloc(count * n * sizeof *caught);
  if (force == NULL || caught == NULL) {
    exit(EXIT_FAILURE);
  }
  supine_physics_force_columns(lungs, &model.force, force);
  model.reach = length;
  const double begin = processor_seconds();
  need(supine_physics_model_network(lungs, &model, &network), &error);
  need(supine_physics_equilibrium_create(network, count, 0, &equilibrium), &error);
  need(supine_physics_equilibrium_set_stiffness(equilibrium, NULL, &error), &error);
  const double middle = processor_seconds();
  need(supine_physics_equilibrium_solve(equilibrium, count, force, 0.0, false, caught, report,
                                        &error),
       &error);
  seconds[0] = fmin(seconds[0], middle - begin);
  seconds[1] = fmin(seconds[1], processor_seconds() - middle);
  supine_physics_equilibrium_destroy(equilibrium);
  supine_physics_network_destroy(network);
  free(force);
  free(caught);
}

static void sample(const supine_lungs *lungs, double length) {
  enum { BAND = 7 };
  supine_model model = supine_physics_model(SUPINE_LAW_PAPER);
  supine_projection projection = {0};
  supine_error error = {0};
  model.force.soften = 1.0;
  model.reach = length;
  const double wall = supine_clock_seconds();
  const double begin = processor_seconds();
  need(supine_projection_sampled(lungs, &model, BAND, NULL, NULL, &projection, &error), &error);
  const double seconds = processor_seconds() - begin;
  (void)printf("%8zu %6.0f %10.1f %12.1f %10zu %10.0e\n", lungs->mesh.vertex_count, length,
               (double)projection.solve_count / (supine_clock_seconds() - wall),
               1e9 * seconds / (double)(projection.solve_count * lungs->mesh.vertex_count),
               projection.iterations, projection.residual);
  supine_projection_free(&projection);
}

int main(int argc, char **argv) {
  static const size_t sizes[] = {10000, 40000, 508000, 2000000};
  enum { SIZES = sizeof sizes / sizeof *sizes };
  const size_t largest = argc > 1 ? (size_t)strtoul(argv[1], NULL, 10) : sizes[SIZES - 1];
  const int repeats = argc > 2 ? (int)strtol(argv[2], NULL, 10) : 3;
  supine_lungs lungs[SIZES] = {0};
  (void)printf("the columns of the force, set up and solved to the default residual, %zu threads\n"
               "processor time, the least of %d\n"
               "                   setting up      solving\n"
               "vertices  reach   us a vertex  us a vertex   steps   residual\n",
               supine_thread_count(), repeats);
  for (size_t s = 0; s < SIZES && sizes[s] <= largest; ++s) {
    supine_mesh mesh = {0};
    supine_error error = {0};
    need(supine_phantom_create(sizes[s], 2500.0, &mesh, &error), &error);
    need(supine_lungs_create(&mesh, 1, NULL, &lungs[s], &error), &error);
    supine_mesh_free(&mesh);
    double seconds[2][2] = {{INFINITY, INFINITY}, {INFINITY, INFINITY}};
    supine_solve_report report[2];
    for (int k = 0; k < 2 * repeats; ++k) { /* by turns */
      solve(&lungs[s], k % 2 == 0 ? 0.0 : reach, seconds[k % 2], &report[k % 2]);
    }
    const double vertices = (double)lungs[s].mesh.vertex_count;
    for (int k = 0; k < 2; ++k) {
      (void)printf("%8.0f %6.0f %13.3f %12.3f %7zu %10.0e\n", vertices, k == 0 ? 0.0 : reach,
                   1e6 * seconds[k][0] / vertices, 1e6 * seconds[k][1] / vertices,
                   report[k].iterations, report[k].residual);
    }
  }
  (void)printf("\nsampled route, soften 1, transform included\n"
               "                  solves a   ns a vertex\n"
               "vertices  reach     second     and solve      steps   residual\n");
  for (size_t s = 0; s < SIZES; ++s) {
    if (sizes[s] <= largest && sizes[s] <= 100000) {
      sample(&lungs[s], 0.0);
      sample(&lungs[s], reach);
    }
    supine_lungs_free(&lungs[s]);
  }
  return EXIT_SUCCESS;
}
