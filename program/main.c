/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The program: find the command and run it. */
#include <errno.h>
#include <fcntl.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cblas.h>
#include <gsl/gsl_errno.h>
#include <jansson.h>

#include <supine/version.h>

#include "base/output.h"
#include "base/parallel.h"
#include "program/command/list.h"
#include "program/options/command.h"

static void print_help(void) {
  (void)puts("supine - lungs that deform with gravity, in real time\n"
             "\n"
             "Usage: supine COMMAND [OPTIONS]\n"
             "\n"
             "Commands:");
  for (size_t i = 0; supine_command_list[i] != NULL; ++i) {
    (void)printf("  %-11s %s\n", supine_command_list[i]->name, supine_command_list[i]->summary);
  }
  (void)puts("\n"
             "'supine COMMAND --help' explains a command. To try supine without data:\n"
             "\n"
             "  supine phantom -o lungs.ply\n"
             "  supine precompute lungs.ply -o lungs.safetensors\n"
             "  supine export lungs.safetensors -o lungs.html\n"
             "\n"
             "Then open lungs.html in any browser: the lungs turn and breathe in it.\n"
             "\n"
             "Lengths are in millimetres, volumes in millilitres; axes are the DICOM patient\n"
             "axes (x to the left, y to the back, z to the head).\n"
             "Exit codes: 0 done, 1 wrong usage, 2 wrong input, 3 not in this build,\n"
             "4 failed output, 5 numerical failure.");
}

/* Return the command of a name; if there is none, suggest another and return NULL. */
static const supine_command *find_command(const char *name) {
  enum { NAMES_MAX = 64 };
  const char *names[NAMES_MAX];
  size_t count = 0;
  for (; count < NAMES_MAX && supine_command_list[count] != NULL; ++count) {
    names[count] = supine_command_list[count]->name;
    if (strcmp(name, names[count]) == 0) {
      return supine_command_list[count];
    }
  }
  const char *nearest = supine_options_suggest(name, names, count);
  if (nearest != NULL) {
    (void)fprintf(stderr, "supine: no command '%s'; did you mean '%s'?\n", name, nearest);
  } else {
    (void)fprintf(stderr, "supine: no command '%s'; 'supine --help' lists the commands\n", name);
  }
  return NULL;
}

/* Remove unfinished output files and end the program, because jansson or GSL is out of memory.
 * jansson would leave out values without a message; GSL only calls its error handler. */
static _Noreturn void end_without_memory(void) {
  supine_output_abandon_all();
  (void)fputs("supine: out of memory\n", stderr);
  exit(SUPINE_EXIT_NUMERICAL);
}

static void *allocate_json(size_t size) {
  void *memory = malloc(size);
  if (memory == NULL) {
    end_without_memory();
  }
  return memory;
}

/* Handle an error of GSL: end the program if memory has run out. GSL returns all other errors. */
static void handle_gsl(const char *reason, const char *file, int line, int code) {
  (void)reason;
  (void)file;
  (void)line;
  if (code == GSL_ENOMEM) {
    end_without_memory();
  }
}

/* Open those of the descriptors 0 to 2 that are closed, so that no file gets their numbers: output
 * meant for the user would go into it. Reading standard input and writing standard output then
 * fail, as they do with a closed descriptor; messages are dropped. */
static void open_standard_descriptors(void) {
  for (int descriptor = STDIN_FILENO; descriptor <= STDERR_FILENO; ++descriptor) {
    if (fcntl(descriptor, F_GETFD) < 0 && errno == EBADF) {
      (void)open("/dev/null", descriptor == STDOUT_FILENO ? O_RDONLY : O_WRONLY);
    }
  }
}

/* Under a limit of addresses (ulimit -v), start the program again without the threads of OpenBLAS.
 * When it is loaded, it starts one for each other processor. Each maps 128 MiB, and tries for ever
 * if it cannot; the program would wait for it at its end. */
static void restart_without_blas_threads(char **argv) {
  static const char name[] = "OPENBLAS_NUM_THREADS";
  const char *threads = getenv(name); /* NOLINT(concurrency-mt-unsafe) */
  struct rlimit addresses;
  if (getrlimit(RLIMIT_AS, &addresses) == 0 && addresses.rlim_cur != RLIM_INFINITY &&
      (threads == NULL || strcmp(threads, "1") != 0) && setenv(name, "1", 1) == 0) {
    (void)execv("/proc/self/exe", argv); /* on failure, go on with these threads */
  }
}

int main(int argc, char **argv) {
  restart_without_blas_threads(argv);
  open_standard_descriptors();
  (void)gsl_set_error_handler(handle_gsl);
  json_set_alloc_funcs(allocate_json, free);
  openblas_set_num_threads(1); /* OpenBLAS's threads would busy-wait beside the program's own */
  (void)setenv("OMP_THREAD_LIMIT", "1", 0); /* CHOLMOD's loops are too short to gain from threads */
  supine_options_signals_catch(false);
  if (argc < 2) {
    print_help();
    return SUPINE_EXIT_USAGE;
  }
  const char *name = argv[1];
  if (strcmp(name, "help") == 0 && argc > 2) { /* "supine help deform" */
    char help[] = "--help";
    char *words[] = {argv[2], help, NULL};
    const supine_command *about = find_command(argv[2]);
    return about == NULL ? SUPINE_EXIT_USAGE : supine_options_run(about, 2, words);
  }
  if (strcmp(name, "--help") == 0 || strcmp(name, "-h") == 0 || strcmp(name, "help") == 0) {
    print_help();
    return supine_options_finish("help");
  }
  if (strcmp(name, "--version") == 0) {
    (void)puts("supine " SUPINE_VERSION);
    return supine_options_finish("version");
  }
  const supine_command *command = find_command(name);
  if (command == NULL) {
    return SUPINE_EXIT_USAGE;
  }
  if (!supine_thread_count_is_valid()) {
    supine_options_say(name, "SUPINE_THREADS is '%s': set a number from 1 to 256, or unset it",
                       getenv("SUPINE_THREADS")); /* NOLINT(concurrency-mt-unsafe) */
    return SUPINE_EXIT_USAGE;
  }
  return supine_options_run(command, argc - 1, argv + 1);
}
