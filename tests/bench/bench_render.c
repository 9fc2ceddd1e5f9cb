/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Made lungs of 109,000 vertices drawn in 5 postures from 4 sides, and one turn of 2 s: seconds,
 * processor seconds and memory of the program itself.
 *
 *     bench_render path/to/supine [FOLDER] */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "program.h"

/* The fastest of three. */
static void take(const char *what, char *const *arguments) {
  program_cost least = bench_program_run(what, arguments);
  for (int turn = 1; turn < 3; ++turn) {
    const program_cost cost = bench_program_run(what, arguments);
    least.wall = fmin(least.wall, cost.wall);
    least.processors = fmin(least.processors, cost.processors);
    least.memory = cost.memory;
  }
  bench_program_print(what, least);
}

int main(int argc, char **argv) {
  if (argc < 2 || (argc > 2 && chdir(argv[2]) != 0)) {
    (void)fprintf(stderr, "usage: bench_render path/to/supine [FOLDER]\n");
    return 1;
  }
  char *const program = realpath(argv[1], NULL);
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
  (void)bench_program_run("phantom", phantom);
  (void)bench_program_run("precompute", basis);
  take("109,000 vertices, 5 x 4 panels", panels);
  take("109,000 vertices, a turn of 31 frames", turn);
  free(program);
  return 0;
}
