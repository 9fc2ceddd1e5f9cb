/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The equilibrium solve: conjugate gradients against successive over-relaxation to the same residual, and
 * full solves a second of the sampled route, from 5 to 80 thousand vertices. One thread for the
 * comparison, which is interleaved and keeps the least of each; all for the sampled route.
 *
 *     bench_solve [REPEATS] */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <supine/parallel.h>
#include <supine/phantom.h>
#include <supine/projection.h>

enum { RHS = 4, SWEEPS_MAX = 200 };

static const double tolerance = 1e-14;

static double now(void) {
  struct timespec time;
  (void)clock_gettime(CLOCK_MONOTONIC, &time);
  return (double)time.tv_sec + 1.0e-9 * (double)time.tv_nsec;
}

/* The reduced matrix for uniform stiffness, rows compressed, with its diagonal scaled to 1: by the
 * formulas of equilibrium.h alone. */
typedef struct matrix {
  size_t count;
  size_t *begin;
  uint32_t *column;
  double *weight, *scale;
} matrix;

static matrix matrix_create(const supine_lungs *lungs) {
  const supine_topology *edges = &lungs->topology;
  matrix a = {.count = lungs->mesh.vertex_count};
  a.begin = calloc(a.count + 2, sizeof *a.begin);
  a.column = malloc(2 * edges->edge_count * sizeof *a.column);
  a.weight = malloc(2 * edges->edge_count * sizeof *a.weight);
  a.scale = malloc(a.count * sizeof *a.scale);
  for (size_t i = 0; i < a.count; ++i) {
    a.scale[i] = 1.0;
  }
  for (size_t e = 0; e < 2 * edges->edge_count; ++e) {
    ++a.begin[edges->edges[e] + 2];
  }
  for (size_t i = 2; i < a.count + 2; ++i) {
    a.begin[i] += a.begin[i - 1];
  }
  for (size_t e = 0; e < edges->edge_count; ++e) {
    const uint32_t *ends = edges->edges + 2 * e;
    const double *p = lungs->mesh.vertices + 3 * (size_t)ends[0];
    const double *q = lungs->mesh.vertices + 3 * (size_t)ends[1];
    const double d = fmax(1.0, 0.5 * hypot(hypot(p[0] - q[0], p[1] - q[1]), p[2] - q[2]));
    const double k = 1.0 / (d * (d + 2.0));
    for (size_t side = 0; side < 2; ++side) {
      const size_t slot = a.begin[ends[side] + 1]++;
      a.column[slot] = ends[1 - side];
      a.weight[slot] = k;
      a.scale[ends[side]] += 1.0 / d - k;
    }
  }
  for (size_t i = 0; i < a.count; ++i) {
    a.scale[i] = 1.0 / sqrt(a.scale[i]);
  }
  for (size_t i = 0; i < a.count; ++i) {
    for (size_t s = a.begin[i]; s < a.begin[i + 1]; ++s) {
      a.weight[s] *= a.scale[i] * a.scale[a.column[s]];
    }
  }
  return a;
}

static void matrix_free(matrix *a) {
  free(a->begin);
  free(a->column);
  free(a->weight);
  free(a->scale);
}

/* One sweep of over-relaxation over rows of RHS unknowns; the largest relative residual of the rows
 * as they stood when met, which is what tells it to stop. */
__attribute__((noinline)) static double sweep(const matrix *a, double omega, const double *b,
                                              double *x, double norm) {
  double residual2[RHS] = {0.0};
  for (size_t i = 0; i < a->count; ++i) {
    double row[RHS];
    for (size_t r = 0; r < RHS; ++r) {
      row[r] = b[i * RHS + r] - x[i * RHS + r];
    }
    for (size_t s = a->begin[i]; s < a->begin[i + 1]; ++s) {
      const double weight = a->weight[s];
      const double *other = x + (size_t)a->column[s] * RHS;
      for (size_t r = 0; r < RHS; ++r) {
        row[r] += weight * other[r];
      }
    }
    for (size_t r = 0; r < RHS; ++r) {
      residual2[r] += row[r] * row[r];
      x[i * RHS + r] += omega * row[r];
    }
  }
  double largest = 0.0;
  for (size_t r = 0; r < RHS; ++r) {
    largest = fmax(largest, sqrt(residual2[r]) / norm);
  }
  return largest;
}

static size_t relax(const matrix *a, double omega, const double *b, double *x, double norm) {
  memset(x, 0, a->count * RHS * sizeof *x);
  size_t sweeps = 1;
  while (sweep(a, omega, b, x, norm) > tolerance && sweeps < SWEEPS_MAX) {
    ++sweeps;
  }
  return sweeps;
}

static void compare(const supine_lungs *lungs, int repeats) {
  const size_t n = lungs->mesh.vertex_count;
  matrix a = matrix_create(lungs);
  supine_network *network = NULL;
  supine_equilibrium *equilibrium = NULL;
  supine_solve_report report = {0};
  double *force = malloc(RHS * n * sizeof *force);
  double *caught = malloc(RHS * n * sizeof *caught);
  double *b = malloc(RHS * n * sizeof *b);
  double *x = malloc(RHS * n * sizeof *x);
  const supine_force_law law = supine_force_law_default();
  if (force == NULL || caught == NULL || b == NULL || x == NULL ||
      supine_network_create(&lungs->mesh, &lungs->topology, &network) != SUPINE_OK ||
      supine_equilibrium_create(network, RHS, 1, &equilibrium) != SUPINE_OK ||
      supine_equilibrium_set_stiffness(equilibrium, NULL, NULL) != SUPINE_OK) {
    exit(EXIT_FAILURE);
  }
  supine_force_columns(lungs, &law, force);
  double norm2[RHS] = {0.0};
  for (size_t i = 0; i < n; ++i) {
    for (size_t r = 0; r < RHS; ++r) {
      b[i * RHS + r] = a.scale[i] * force[i * RHS + r];
      norm2[r] += b[i * RHS + r] * b[i * RHS + r];
    }
  }
  double norm = INFINITY;
  for (size_t r = 0; r < RHS; ++r) {
    norm = fmin(norm, sqrt(norm2[r]));
  }
  double omega = 1.0;
  size_t sweeps = SWEEPS_MAX;
  for (double trial = 1.0; trial < 1.3; trial += 0.02) { /* its best factor, found beforehand */
    const size_t count = relax(&a, trial, b, x, norm);
    if (count < sweeps) {
      sweeps = count;
      omega = trial;
    }
  }
  double gradients = INFINITY;
  double relaxation = INFINITY;
  for (int repeat = 0; repeat < repeats; ++repeat) {
    double begin = now();
    if (supine_equilibrium_solve(equilibrium, RHS, force, tolerance, false, caught, &report,
                                 NULL) != SUPINE_OK) {
      exit(EXIT_FAILURE);
    }
    gradients = fmin(gradients, now() - begin);
    begin = now();
    (void)relax(&a, omega, b, x, norm);
    relaxation = fmin(relaxation, now() - begin);
  }
  double difference = 0.0;
  double largest = 0.0;
  for (size_t i = 0; i < n; ++i) { /* F = scale v where E = 1 */
    difference = fmax(difference, fabs(a.scale[i] * x[i * RHS] - caught[i * RHS]));
    largest = fmax(largest, fabs(caught[i * RHS]));
  }
  (void)printf("%8zu  %3zu steps %8.2f ms   %3zu sweeps (omega %.2f) %8.2f ms   %5.2f   %.0e\n", n,
               report.iterations, 1e3 * gradients, sweeps, omega, 1e3 * relaxation,
               relaxation / gradients, difference / largest);
  supine_equilibrium_destroy(equilibrium);
  supine_network_destroy(network);
  matrix_free(&a);
  free(force);
  free(caught);
  free(b);
  free(x);
}

static void sample(const supine_lungs *lungs) {
  enum { BAND = 7 };
  supine_force_law law = supine_force_law_default();
  supine_projection projection = {0};
  supine_error error;
  law.soften = 1.0;
  const double begin = now();
  if (supine_project_sampled(lungs, &law, NULL, BAND, 0.0, NULL, NULL, &projection, &error) !=
      SUPINE_OK) {
    (void)fprintf(stderr, "%s\n", error.message);
    exit(EXIT_FAILURE);
  }
  const double seconds = now() - begin;
  (void)printf("%8zu  %8.1f solves a second   %6.1f ns a vertex and solve   at most %zu steps\n",
               lungs->mesh.vertex_count, (double)projection.solve_count / seconds,
               1e9 * seconds / (double)(projection.solve_count * lungs->mesh.vertex_count),
               projection.iterations);
  supine_projection_free(&projection);
}

int main(int argc, char **argv) {
  static const size_t sizes[] = {5000, 10000, 20000, 40000, 80000};
  enum { SIZES = sizeof sizes / sizeof *sizes };
  const int repeats = argc > 1 ? atoi(argv[1]) : 7;
  supine_lungs lungs[SIZES] = {0};
  for (size_t s = 0; s < SIZES; ++s) {
    supine_mesh mesh = {0};
    if (supine_phantom_create(sizes[s], 2500.0, &mesh, NULL) != SUPINE_OK ||
        supine_lungs_create(&mesh, 1, NULL, &lungs[s], NULL) != SUPINE_OK) {
      return EXIT_FAILURE;
    }
    supine_mesh_free(&mesh);
  }
  (void)printf("four right-hand sides to a relative residual of %.0e, one thread\n"
               "vertices  conjugate gradients    over-relaxation                     ratio   "
               "difference\n",
               tolerance);
  for (size_t s = 0; s < SIZES; ++s) {
    compare(&lungs[s], repeats);
  }
  (void)printf("\nsampled route, soften 1, %zu threads, warm starts, transform included\n",
               supine_thread_count());
  for (size_t s = 0; s < SIZES; ++s) {
    sample(&lungs[s]);
    supine_lungs_free(&lungs[s]);
  }
  return EXIT_SUCCESS;
}
