/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Made lungs of 109,000 vertices drawn in 5 postures from 4 sides, and one turn of 2 s: seconds,
 * processor seconds and memory of the program itself.
 *
 *     bench_render path/to/supine [FOLDER] */
#include <stdio.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "sh/base/clock.h"

/* Runs the program, its output left out; what it took goes to `used`, the answer is its wall time.
 */
static double run(char *const *arguments, struct rusage *used) {
  int status = 0;
  const double start = supine_clock_seconds();
  const pid_t child = fork();
  if (child == 0) {
    if (freopen("/dev/null", "w", stdout) == NULL) {
      _exit(1);
    }
    (void)execv(arguments[0], arguments);
    _exit(127);
  }
  if (child < 0 || wait4(child, &status, 0, used) != child || status != 0) {
    (void)fprintf(stderr, "supine %s: failed\n", arguments[1]);
    exit(1);
  }
  return supine_clock_seconds() - start;
}

static double seconds(struct timeval t) {
  return (double)t.tv_sec + 1e-6 * (double)t.tv_usec;
}

/* The fastest of three. */
static void take(const char *what, char *const *arguments) {
  double least[2] = {1e9, 1e9};
  double memory = 0.0;
  for (int turn = 0; turn < 3; ++turn) {
    struct rusage used = {0};
    const double wall = run(arguments, &used);
    const double processors = seconds(used.ru_utime) + seconds(used.ru_stime);
    least[0] = wall < least[0] ? wall : least[0];
    least[1] = processors < least[1] ? processors : least[1];
    memory = 1e-6 * (double)used.ru_maxrss;
  }
  (void)printf("%-40s %6.1f s  %6.1f s of processors  %6.2f GB\n", what, least[0], least[1],
               memory);
  (void)fflush(stdout);
}

int main(int argc, char **argv) {
  if (argc < 2 || (argc > 2 && chdir(argv[2]) != 0)) {
    (void)fprintf(stderr, "usage: bench_render path/to/supine [FOLDER]\n");
    return 1;
  }
  char *const program = realpath(argv[1], NULL);
  struct rusage used;
  if (program == NULL) {
    return 1;
  }
  char *const phantom[] = {program, "phantom", "--vertices", "109000", "-o", "bench.ply", NULL};
  char *const basis[] = {program, "precompute", "bench.ply", "-o", "bench.safetensors", NULL};
  char *const panels[] = {program,
                          "render",
                          "bench.safetensors",
                          "--posture",
                          "supine,prone,left,right,upright",
                          "--view",
                          "anterior,posterior,left,right",
                          "-o",
                          "bench.png",
                          NULL};
  char *const turn[] = {program,          "render", "bench.safetensors", "--turn",
                        "supine:left:2s", "-o",     "bench.webp",        NULL};
  (void)run(phantom, &used);
  (void)run(basis, &used);
  take("109,000 vertices, 5 x 4 panels", panels);
  take("109,000 vertices, a turn of 31 frames", turn);
  free(program);
  return 0;
}
