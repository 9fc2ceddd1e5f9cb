/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef SUPINE_BENCH_PROGRAM_H
#define SUPINE_BENCH_PROGRAM_H

typedef struct program_cost {
  double wall, processors; /* s */
  double memory;           /* GB, at most */
} program_cost;

/* Runs a program, its output left out; ends this one, naming `what`, where it fails. */
program_cost bench_program_run(const char *what, char *const *arguments);
/* A line of what something cost. */
void bench_program_print(const char *what, program_cost cost);

#endif
