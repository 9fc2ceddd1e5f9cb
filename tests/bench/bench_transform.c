/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The forward transform against one OpenBLAS dgemm with the dense analysis matrix.
 *
 *     bench_transform [FIELDS [REPEATS]]        default 100000 fields, 9 repeats
 *
 * Double precision, the critical grid of each band, values [direction][field] for both, and
 * coefficients written [coefficient][field] by both, then [field][coefficient] by both.
 * The contenders take turns within one process and the least time of each counts. OpenBLAS is
 * given the kernels that it is fastest with here: it may not know a newer processor. */
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cblas.h>

#include "sh/base/clock.h"
#include "sh/grid.h"
#include "sh/transform.h"
#include <supine/sh.h>

#define CHOSEN "SUPINE_BENCH_KERNELS"

static void *allocate(size_t doubles) {
  void *memory = malloc(doubles * sizeof(double));
  if (memory == NULL) {
    (void)fprintf(stderr, "bench_transform: out of memory\n");
    exit(EXIT_FAILURE);
  }
  return memory;
}

/* GFLOP/s of dgemm alone at a size like band 15's. */
static double probe_dgemm(void) {
  enum { M = 256, K = 512, N = 4000 };
  double *a = allocate(M * K);
  double *b = allocate((size_t)K * N);
  double *c = allocate((size_t)M * N);
  memset(a, 0, sizeof *a * M * K);
  memset(b, 0, sizeof *b * K * N);
  double best = INFINITY;
  openblas_set_num_threads(1);
  for (int r = 0; r < 5; ++r) {
    const double start = supine_clock_seconds();
    cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasNoTrans, M, N, K, 1, a, K, b, N, 0, c, N);
    best = fmin(best, supine_clock_seconds() - start);
  }
  free(c);
  free(b);
  free(a);
  return 2e-9 * M * K * N / best;
}

/* Starts this program again under the fastest of OpenBLAS's kernels, whatever the environment
 * asked OpenBLAS for. */
static void choose_kernels(char **arguments) {
  static const char *const names[] = {"HASWELL", "ZEN", "SKYLAKEX", "COOPERLAKE", "SAPPHIRERAPIDS"};
  char self[4096];
  const ssize_t length = readlink("/proc/self/exe", self, sizeof self - 1);
  if (length < 0 || getenv(CHOSEN) != NULL) {
    return;
  }
  self[length] = '\0';
  (void)unsetenv("OPENBLAS_L2_SIZE");
  const char *best = NULL;
  double most = 0;
  for (size_t i = 0; i < sizeof names / sizeof *names; ++i) {
    char command[4200];
    (void)snprintf(command, sizeof command, "OPENBLAS_CORETYPE=%s '%s' --probe", names[i], self);
    char line[128] = "";
    FILE *pipe = popen(command, "r"); /* NOLINT(cert-env33-c): this program's own path */
    if (pipe != NULL && fgets(line, sizeof line, pipe) != NULL) {
      const double speed = strtod(line, NULL);
      printf("dgemm with %-14s kernels: %6.1f GFLOP/s\n", names[i], speed);
      if (speed > most) {
        most = speed;
        best = names[i];
      }
    }
    if (pipe != NULL) {
      (void)pclose(pipe);
    }
  }
  (void)fflush(stdout);
  if (best != NULL && setenv("OPENBLAS_CORETYPE", best, 1) == 0 && setenv(CHOSEN, best, 1) == 0) {
    (void)execv(self, arguments);
  }
}

static void *arithmetic(void *argument) {
  double *sums = argument;
  double x[16];
  for (int k = 0; k < 16; ++k) {
    x[k] = 1 + 0.01 * k;
  }
  for (long i = 0; i < 20000000; ++i) {
    for (int k = 0; k < 16; ++k) {
      x[k] = x[k] * 0.999999 + 1e-7;
    }
  }
  for (int k = 0; k < 16; ++k) {
    sums[k] += x[k];
  }
  return NULL;
}

/* What a second thread gains where nothing but arithmetic is done. */
static double probe_threads(void) {
  static double sums[2][64];
  double one = INFINITY;
  double two = INFINITY;
  for (int r = 0; r < 5; ++r) {
    double start = supine_clock_seconds();
    (void)arithmetic(sums[0]);
    one = fmin(one, supine_clock_seconds() - start);
    pthread_t other;
    start = supine_clock_seconds();
    if (pthread_create(&other, NULL, arithmetic, sums[1]) != 0) {
      return 1;
    }
    (void)arithmetic(sums[0]);
    (void)pthread_join(other, NULL);
    two = fmin(two, supine_clock_seconds() - start);
  }
  return 2 * one / two;
}

/* The dense analysis matrix [coefficients, points]. */
static double *analysis_matrix(size_t band, const supine_sh_grid *grid) {
  const size_t count = supine_sh_count(band);
  const size_t points = grid->latitudes * grid->longitudes;
  double *matrix = allocate(count * points);
  double *y = allocate(count);
  for (size_t i = 0; i < points; ++i) {
    double d[3];
    supine_sh_grid_direction(grid, i / grid->longitudes, i % grid->longitudes, d);
    (void)supine_sh_evaluate(band, d, y);
    const double w = grid->weight[i / grid->longitudes] * 2 * M_PI / (double)grid->longitudes;
    for (size_t c = 0; c < count; ++c) {
      matrix[c * points + i] = w * y[c];
    }
  }
  free(y);
  return matrix;
}

static void compare(size_t band, size_t fields, int repeats) {
  supine_sh_grid *grid = NULL;
  supine_sh_transform *plan = NULL;
  if (supine_sh_grid_create(band + 1, 2 * band + 2, &grid) != SUPINE_OK ||
      supine_sh_transform_create(band, grid, &plan, NULL) != SUPINE_OK) {
    (void)fprintf(stderr, "bench_transform: cannot plan band %zu\n", band);
    exit(EXIT_FAILURE);
  }
  const size_t count = supine_sh_count(band);
  const size_t points = grid->latitudes * grid->longitudes;
  double *matrix = analysis_matrix(band, grid);
  double *values = allocate(points * fields);
  double *dense = allocate(count * fields);
  double *dense_together = allocate(count * fields);
  double *fast = allocate(count * fields);
  for (size_t i = 0; i < points * fields; ++i) {
    values[i] = sin(0.37 * (double)i);
  }
  for (size_t threads = 1; threads <= 2; ++threads) {
    double time_dense = INFINITY;
    double time_fast = INFINITY;
    double time_together = INFINITY;
    double time_dense_together = INFINITY;
    double worst = 0;
    openblas_set_num_threads((int)threads);
    for (int r = 0; r < repeats; ++r) {
      double start = supine_clock_seconds();
      cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasNoTrans, (int)count, (int)fields, (int)points,
                  1, matrix, (int)points, values, (int)fields, 0, dense, (int)fields);
      time_dense = fmin(time_dense, supine_clock_seconds() - start);
      start = supine_clock_seconds();
      cblas_dgemm(CblasRowMajor, CblasTrans, CblasTrans, (int)fields, (int)count, (int)points, 1,
                  values, (int)fields, matrix, (int)points, 0, dense_together, (int)count);
      time_dense_together = fmin(time_dense_together, supine_clock_seconds() - start);
      supine_sh_batch batch = {.fields = fields, .threads = threads};
      start = supine_clock_seconds();
      (void)supine_sh_forward(plan, &batch, values, fast, NULL);
      time_together = fmin(time_together, supine_clock_seconds() - start);
      batch.coefficient_stride = fields;
      start = supine_clock_seconds();
      (void)supine_sh_forward(plan, &batch, values, fast, NULL);
      time_fast = fmin(time_fast, supine_clock_seconds() - start);
    }
    for (size_t i = 0; i < count * fields; ++i) {
      worst = fmax(worst, fabs(fast[i] - dense[i]));
    }
    const double scale = 1e6 / (double)fields;
    printf("%4zu %4zu x %-4zu %7zu %9.4f %10.4f %7.2f %9.4f %10.4f %7.2f   %.1e\n", band,
           grid->latitudes, grid->longitudes, threads, time_dense * scale, time_fast * scale,
           time_dense / time_fast, time_dense_together * scale, time_together * scale,
           time_dense_together / time_together, worst);
    (void)fflush(stdout);
  }
  free(fast);
  free(dense_together);
  free(dense);
  free(values);
  free(matrix);
  supine_sh_transform_destroy(plan);
  supine_sh_grid_destroy(grid);
}

int main(int count, char **arguments) {
  static const size_t bands[] = {3, 7, 15, 31};
  if (count > 1 && strcmp(arguments[1], "--probe") == 0) {
    printf("%g\n", probe_dgemm());
    return EXIT_SUCCESS;
  }
  choose_kernels(arguments);
  const long fields = count > 1 ? strtol(arguments[1], NULL, 10) : 100000;
  const long repeats = count > 2 ? strtol(arguments[2], NULL, 10) : 9;
  if (fields < 1 || repeats < 1) {
    (void)fprintf(stderr, "usage: bench_transform [FIELDS [REPEATS]]\n");
    return EXIT_FAILURE;
  }
  printf("OpenBLAS kernels: %s; %ld fields, least of %ld\n", openblas_get_corename(), fields,
         repeats);
  printf("two threads of arithmetic alone do %.2f times the work of one\n", probe_threads());
  printf("                            us a field, coefficients      us a field, coefficients\n");
  printf("                            [coefficient][field]          [field][coefficient]\n");
  printf("band    grid    threads     dgemm  transform   ratio     dgemm  transform   ratio  "
         " difference\n");
  for (size_t i = 0; i < sizeof bands / sizeof *bands; ++i) {
    /* band 31 has 16 times the data of band 7: fewer fields keep it in memory */
    compare(bands[i], bands[i] > 15 ? ((size_t)fields + 3) / 4 : (size_t)fields, (int)repeats);
  }
  return EXIT_SUCCESS;
}
