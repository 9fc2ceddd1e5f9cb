/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The equilibrium solve, on made lungs: steps and processor time a vertex of the linear route's
 * right-hand sides, with and without a reach, from 10 thousand to 2 million vertices; solves of
 * many directions beside the plainest way, one at a time; the sampled route beside the smooth one;
 * the whole of a precomputation by law, and its memory.
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
#include "precompute/projection/sampler.h"
#include "sh/base/clock.h"
#include "sh/base/parallel.h"
#include <supine/sh.h>

#include "plain_solve.h"

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

static supine_lungs make_lungs(size_t vertices) {
  supine_mesh mesh = {0};
  supine_lungs lungs = {0};
  supine_error error = {0};
  need(supine_phantom_create(vertices, 2500.0, &mesh, &error), &error);
  need(supine_lungs_create(&mesh, 1, NULL, &lungs, &error), &error);
  supine_mesh_free(&mesh);
  return lungs;
}

static supine_model soft_model(double length) {
  supine_model model = supine_physics_model(SUPINE_LAW_PAPER);
  model.force.soften = 1.0;
  model.reach = length;
  return model;
}

/* Root of the sum of squares of a - b over that of b. */
static double difference(size_t count, const double *a, const double *b) {
  double miss = 0.0;
  double all = 0.0;
  for (size_t i = 0; i < count; ++i) {
    miss += (a[i] - b[i]) * (a[i] - b[i]);
    all += b[i] * b[i];
  }
  return sqrt(miss / all);
}

/* Directions along a ring, one at a time and eight at a time, by turns. */
static void solve_directions(const supine_lungs *lungs, double length, int repeats) {
  enum { COUNT = 48, PLAIN = 8, WAYS = 3 };
  static const double tolerances[WAYS] = {1e-14, SUPINE_SAMPLE_TOLERANCE, SUPINE_SAMPLE_TOLERANCE};
  const size_t n = lungs->mesh.vertex_count;
  const supine_model model = soft_model(length);
  supine_error error = {0};
  supine_sampler *sampler = NULL;
  supine_solve_report report = {0};
  double directions[3 * COUNT];
  double seconds[WAYS] = {INFINITY, INFINITY, INFINITY};
  size_t steps[2] = {0};
  double *fields = malloc(COUNT * n * sizeof *fields);
  double *plain = malloc(PLAIN * n * sizeof *plain);
  plain_solve *one = plain_solve_create(lungs, &model);
  if (fields == NULL || plain == NULL || one == NULL) {
    exit(EXIT_FAILURE);
  }
  for (size_t d = 0; d < COUNT; ++d) {
    const double at = 2.0 * M_PI * (double)d / COUNT;
    const double g[3] = {0.8 * cos(at), 0.8 * sin(at), 0.6};
    memcpy(directions + 3 * d, g, sizeof g);
  }
  need(supine_projection_sampler_create(lungs, &model, &sampler, &error), &error);
  for (int k = 0; k < WAYS * repeats; ++k) {
    const int way = k % WAYS;
    const double begin = processor_seconds();
    if (way == WAYS - 1) {
      need(supine_projection_sampler_solve(sampler, COUNT, directions, false, fields, &report,
                                           &error),
           &error);
    }
    for (size_t d = 0; d < PLAIN && way < WAYS - 1; ++d) {
      steps[way] = plain_solve_run(one, directions + 3 * d, tolerances[way], false, plain + d * n);
    }
    const double count = way == WAYS - 1 ? COUNT : PLAIN;
    seconds[way] = fmin(seconds[way], (processor_seconds() - begin) / count);
  }
  (void)plain_solve_run(one, directions, tolerances[0], false, plain);
  (void)printf("%8zu %6.0f %8.0f (%4zu) %8.0f (%4zu) %5.0f (%3zu) %9.1f %6.1f %11.0e\n", n, length,
               1e9 * seconds[0] / (double)n, steps[0], 1e9 * seconds[1] / (double)n, steps[1],
               1e9 * seconds[2] / (double)n, report.iterations, seconds[0] / seconds[2],
               seconds[1] / seconds[2], difference(n, fields, plain));
  plain_solve_destroy(one);
  supine_projection_sampler_destroy(sampler);
  free(fields);
  free(plain);
}

/* Coefficients [N, P]. */
static double *coefficients_of(const supine_projection *projection) {
  const size_t terms = supine_sh_count(projection->band);
  double *c = calloc(projection->vertex_count * terms, sizeof *c);
  if (c == NULL) {
    exit(EXIT_FAILURE);
  }
  for (size_t i = 0; i < projection->vertex_count; ++i) {
    for (size_t r = 0; r < projection->rank; ++r) {
      const double column = projection->columns[i * projection->rank + r];
      for (size_t t = 0; t < terms && projection->functions != NULL; ++t) {
        c[i * terms + t] += column * projection->functions[r * terms + t];
      }
      c[i * terms + r] = projection->functions == NULL ? column : c[i * terms + r];
    }
  }
  return c;
}

static void project(const supine_lungs *lungs, double length) {
  enum { BAND = 23 };
  const supine_model model = soft_model(length);
  supine_error error = {0};
  double seconds[2];
  size_t solves[2];
  double *coefficients[2];
  for (int k = 0; k < 2; ++k) {
    supine_projection projection = {0};
    const double begin = processor_seconds();
    need((k == 0 ? supine_projection_sampled : supine_projection_smooth)(lungs, &model, BAND, NULL,
                                                                         NULL, &projection, &error),
         &error);
    seconds[k] = processor_seconds() - begin;
    solves[k] = projection.solve_count;
    coefficients[k] = coefficients_of(&projection);
    supine_projection_free(&projection);
  }
  const size_t values = lungs->mesh.vertex_count * supine_sh_count(BAND);
  (void)printf("%8zu %6.0f %8.2f (%4zu) %8.2f (%4zu) %9.1f %10.1e\n", lungs->mesh.vertex_count,
               length, seconds[0], solves[0], seconds[1], solves[1], seconds[0] / seconds[1],
               difference(values, coefficients[1], coefficients[0]));
  free(coefficients[0]);
  free(coefficients[1]);
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
  static const supine_law laws[] = {SUPINE_LAW_PAPER, SUPINE_LAW_DEEP};
  double seconds[2] = {INFINITY, INFINITY};
  supine_precompute_report report;
  for (int k = 0; k < 2 * repeats; ++k) { /* by turns */
    const supine_model model = supine_physics_model(laws[k % 2]);
    seconds[k % 2] = fmin(seconds[k % 2], precompute(lungs, &model, &report));
  }
  (void)printf("\nprecompute, %zu vertices, band 23, processor s, the least of %d by turns:\n"
               "paper %.2f, deep %.2f: %.2f times\n",
               lungs->mesh.vertex_count, repeats, seconds[0], seconds[1], seconds[1] / seconds[0]);
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
  (void)printf("the columns of the force, set up and solved to the default residual, %zu threads\n"
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
  enum { SIZES = sizeof sizes / sizeof *sizes, PAIR = 1, LARGE = 2 };
  const size_t largest = argc > 1 ? (size_t)strtoul(argv[1], NULL, 10) : sizes[SIZES - 1];
  const int repeats = argc > 2 ? (int)strtol(argv[2], NULL, 10) : 3;
  if (sizes[LARGE] <= largest) { /* first: a child's peak counts what its parent holds */
    measure_memory(sizes[LARGE]);
  }
  solve_sizes(sizes, SIZES, largest, repeats);
  if (sizes[PAIR] <= largest) {
    supine_lungs lungs = make_lungs(sizes[PAIR]);
    (void)printf("\none direction at a time, in double, without coarser graphs, beside eight at a "
                 "time; soften 1\nns a vertex and solve (steps), processor time, the least of %d\n"
                 "                       one at a time                        times as fast\n"
                 "vertices  reach        to 1e-14        to %.0e    by eight   as 1e-14  %.0e"
                 "   differ by\n",
                 repeats, SUPINE_SAMPLE_TOLERANCE, SUPINE_SAMPLE_TOLERANCE);
    solve_directions(&lungs, 0.0, repeats);
    solve_directions(&lungs, reach, repeats);
    (void)printf("\nband 23, soften 1: processor s (solves)\n"
                 "vertices  reach   sampled         smooth         times   differ by\n");
    project(&lungs, 0.0);
    project(&lungs, reach);
    supine_lungs_free(&lungs);
  }
  if (sizes[LARGE] <= largest) {
    supine_lungs lungs = make_lungs(sizes[LARGE]);
    compare_laws(&lungs, repeats);
    supine_lungs_free(&lungs);
  }
  return EXIT_SUCCESS;
}
