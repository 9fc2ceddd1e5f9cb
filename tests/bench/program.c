/* SPDX-License-Identifier: GPL-3.0-or-later */
/* What a run of the whole program costs. */
#include <stdio.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "sh/base/clock.h"

#include "program.h"

static double seconds(struct timeval t) {
  return (double)t.tv_sec + 1e-6 * (double)t.tv_usec;
}

program_cost bench_program_run(const char *what, char *const *arguments) {
  struct rusage used = {0};
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
  if (child < 0 || wait4(child, &status, 0, &used) != child || status != 0) {
    (void)fprintf(stderr, "%s: failed\n", what);
    exit(1);
  }
  return (program_cost){supine_clock_seconds() - start,
                        seconds(used.ru_utime) + seconds(used.ru_stime),
                        1e-6 * (double)used.ru_maxrss};
}

void bench_program_print(const char *what, program_cost cost) {
  (void)printf("%-46s %6.1f s  %6.1f s of processors  %6.2f GB\n", what, cost.wall, cost.processors,
               cost.memory);
  (void)fflush(stdout);
}
