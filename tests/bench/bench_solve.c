/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The equilibrium solve, on synthetic lungs: steps and processor time a vertex of four directions
 * of gravity, with and without a reach, from 10 thousand to 2 million vertices; the whole of a
 * precomputation by law and with softening, and its memory.
 *
 *     bench_solve [LARGEST [REPEATS]] */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "precompute/lungs/phantom.h"
#include "precompute/physics/equilibrium.h"
#include "precompute/precompute.h"
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

/* Processor seconds to set up and to solve for four directions of gravity. */
static void solve(const supine_lungs *lungs, double length, double seconds[2],
                  supine_solve_report *report) {
  const size_t n = lungs->mesh.vertex_count;
  supine_model model = supine_physics_model(SUPINE_LAW_PAPER);
  enum { COUNT = 4 };
  static const double g[3 * COUNT] = {0.0, 1.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0};
  double range[2 * COUNT];
  supine_network *network = NULL;
  supine_equilibrium *equilibrium = NULL;
  supine_error error = {0};
  double *force = malloc(COUNT * n * sizeof *force);
  double *caught = malloc(COUNT * n * sizeof *caught);
  if (force == NULL || caught == NULL) {
    exit(EXIT_FAILURE);
  }
  need(supine_physics_height_range(lungs, false, COUNT, g, range, range + COUNT), &error);
  const supine_gravities gravities = {COUNT, g, range, range + COUNT};
  supine_physics_force(lungs, &model.force, &gravities, n, NULL, force);
  model.reach = length;
  const double begin = processor_seconds();
  need(supine_physics_model_network(lungs, &model, &network), &error);
  need(supine_physics_equilibrium_create(network, COUNT, 0, &equilibrium), &error);
  need(supine_physics_equilibrium_set_stiffness(equilibrium, NULL, &error), &error);
  const double middle = processor_seconds();
  need(supine_physics_equilibrium_solve(equilibrium, COUNT, force, 0.0, false, caught, report,
                                        &error),
       &error);
  seconds[0] = fmin(seconds[0], middle - begin);
  seconds[1] = fmin(seconds[1], processor_seconds() - middle);
  supine_physics_equilibrium_destroy(equilibrium);
  supine_physics_network_destroy(network);
  free(force);
  free(caught);
}

static supine_lungs make_lungs(size_t vertices) {
  supine_mesh mesh = {0};
  supine_lungs lungs = {0};
  supine_error error = {0};
  need(supine_phantom_create(vertices, 2500.0, &mesh, &error), &error);
  need(supine_lungs_create(&mesh, 1, NULL, &lungs, &error), &error);
  supine_mesh_free(&mesh);
  return lungs;
}

/* Processor seconds of the whole, from lungs to file. */
static double precompute(const supine_lungs *lungs, const supine_model *model,
                         supine_precompute_report *report) {
  char path[] = "/tmp/supine-bench-XXXXXX";
  const supine_precompute_options options = {.model = *model, .band = 23, .modes = 16};
  supine_error error = {0};
  const double begin = processor_seconds();
  (void)close(mkstemp(path));
  need(supine_precompute(lungs, &options, path, report, &error), &error);
  (void)unlink(path);
  return processor_seconds() - begin;
}

static void compare_laws(const supine_lungs *lungs, int repeats) {
  enum { WAYS = 3 };
  static const supine_law laws[WAYS] = {SUPINE_LAW_PAPER, SUPINE_LAW_DEEP, SUPINE_LAW_DEEP};
  double seconds[WAYS] = {INFINITY, INFINITY, INFINITY};
  supine_precompute_report report;
  for (int k = 0; k < WAYS * repeats; ++k) { /* by turns */
    supine_model model = supine_physics_model(laws[k % WAYS]);
    model.force.soften = k % WAYS == 2 ? 1.0 : 0.0;
    seconds[k % WAYS] = fmin(seconds[k % WAYS], precompute(lungs, &model, &report));
  }
  (void)printf("\nprecompute, %zu vertices, band 23, processor s, the least of %d by turns:\n"
               "paper %.2f, deep %.2f: %.2f times; deep, soften 1 %.2f: %.2f times deep\n",
               lungs->mesh.vertex_count, repeats, seconds[0], seconds[1], seconds[1] / seconds[0],
               seconds[2], seconds[2] / seconds[1]);
}

/* In a process of its own, which alone the peak is of. */
static void measure_memory(size_t vertices) {
  struct rusage usage;
  int state;
  (void)fflush(stdout);
  const pid_t child = fork();
  if (child == 0) {
    supine_lungs lungs = make_lungs(vertices);
    supine_model model = supine_physics_model(SUPINE_LAW_DEEP);
    supine_precompute_report report;
    model.force.soften = 1.0;
    const double seconds = precompute(&lungs, &model, &report);
    (void)printf("precompute, %zu vertices, soften 1, reach %g: %.1f s of processors, %zu solves, "
                 "residual %.0e,\nerror %.3f %%",
                 lungs.mesh.vertex_count, model.reach, seconds, report.solve_count, report.residual,
                 100.0 * report.accuracy.relative_rms);
    supine_lungs_free(&lungs);
    (void)fflush(stdout);
    _exit(EXIT_SUCCESS);
  }
  if (child < 0 || wait4(child, &state, 0, &usage) != child || state != 0) {
    exit(EXIT_FAILURE);
  }
  (void)printf(", peak memory %.2f GB\n\n", 1.024e-6 * (double)usage.ru_maxrss);
}

/* Every size up to the largest, with and without a reach, by turns. */
static void solve_sizes(const size_t *sizes, size_t count, size_t largest, int repeats) {
  enum { SIZES_MAX = 8, PAIR = 1 };
  supine_lungs lungs[SIZES_MAX];
  double seconds[SIZES_MAX][2][2];
  supine_solve_report report[SIZES_MAX][2];
  size_t made = 0;
  for (; made < count && sizes[made] <= largest; ++made) {
    lungs[made] = make_lungs(sizes[made]);
    for (int k = 0; k < 4; ++k) {
      seconds[made][k / 2][k % 2] = INFINITY;
    }
  }
  for (int turn = 0; turn < 2 * repeats; ++turn) {
    for (size_t s = 0; s < made; ++s) {
      const int k = turn % 2;
      solve(&lungs[s], k == 0 ? 0.0 : reach, seconds[s][k], &report[s][k]);
    }
  }
  (void)printf(
      "four directions of gravity, set up and solved to the default residual, %zu threads\n"
      "processor time, the least of %d by turns; beside that of %zu vertices\n"
      "                   setting up      solving\n"
      "vertices  reach   us a vertex  us a vertex  beside   steps   residual\n",
      supine_thread_count(), repeats, sizes[PAIR]);
  for (size_t s = 0; s < made; ++s) {
    for (int k = 0; k < 2; ++k) {
      const double vertices = (double)lungs[s].mesh.vertex_count;
      const size_t pair = made > PAIR ? PAIR : 0;
      const double beside = seconds[pair][k][1] / (double)lungs[pair].mesh.vertex_count;
      (void)printf("%8.0f %6.0f %13.3f %12.3f %7.2f %7zu %10.0e\n", vertices, k == 0 ? 0.0 : reach,
                   1e6 * seconds[s][k][0] / vertices, 1e6 * seconds[s][k][1] / vertices,
                   seconds[s][k][1] / vertices / beside, report[s][k].iterations,
                   report[s][k].residual);
    }
  }
  for (size_t s = 0; s < made; ++s) {
    supine_lungs_free(&lungs[s]);
  }
}

int main(int argc, char **argv) {
  static const size_t sizes[] = {10000, 40000, 508000, 2000000};
  enum { SIZES = sizeof sizes / sizeof *sizes, LARGE = 2 };
  const size_t largest = argc > 1 ? (size_t)strtoul(argv[1], NULL, 10) : sizes[SIZES - 1];
  const int repeats = argc > 2 ? (int)strtol(argv[2], NULL, 10) : 3;
  if (sizes[LARGE] <= largest) { /* first: a child's peak counts what its parent holds */
    measure_memory(sizes[LARGE]);
  }
  solve_sizes(sizes, SIZES, largest, repeats);
  if (sizes[LARGE] <= largest) {
    supine_lungs lungs = make_lungs(sizes[LARGE]);
    compare_laws(&lungs, repeats);
    supine_lungs_free(&lungs);
  }
  return EXIT_SUCCESS;
}
