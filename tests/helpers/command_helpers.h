/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Run a command of the program within the process of the test. */
#ifndef SUPINE_COMMAND_HELPERS_H
#define SUPINE_COMMAND_HELPERS_H

#include "tests/helpers/test.h"

#include "program/options/command.h"

/* Output streams that command_run keeps; it discards the other stream. */
enum { KEPT_OUT = 1, KEPT_ERR = 2, KEPT_BOTH = 3 };

/* Run the command with the arguments `words`, the last of which is NULL. Set text [size] to what
 * the command prints on the streams `kept`, and return its exit code. */
static inline int command_run(const supine_command *command, const char *const *words, int kept,
                              char *text, size_t size) {
  char *argv[24] = {strdup(command->name)};
  int argc = 1;
  for (; words[argc - 1] != NULL; ++argc) {
    argv[argc] = strdup(words[argc - 1]);
  }
  (void)fflush(stdout);
  (void)fflush(stderr);
  const int before[2] = {dup(STDOUT_FILENO), dup(STDERR_FILENO)};
  FILE *file = tmpfile();
  FILE *dropped = fopen("/dev/null", "wb");
  assert_true(file != NULL && dropped != NULL);
  assert_true(dup2(fileno(kept & KEPT_OUT ? file : dropped), STDOUT_FILENO) >= 0);
  assert_true(dup2(fileno(kept & KEPT_ERR ? file : dropped), STDERR_FILENO) >= 0);
  optind = 0; /* tells getopt to start again at the first argument */
  const int code = supine_options_run(command, argc, argv);
  (void)fflush(stdout);
  (void)fflush(stderr);
  assert_true(dup2(before[0], STDOUT_FILENO) >= 0 && dup2(before[1], STDERR_FILENO) >= 0);
  (void)close(before[0]);
  (void)close(before[1]);
  rewind(file);
  text[fread(text, 1, size - 1, file)] = '\0';
  (void)fclose(file);
  (void)fclose(dropped);
  for (int i = 0; i < argc; ++i) {
    free(argv[i]);
  }
  return code;
}

/* Call command_run with the arguments after `text`. `text` must be an array, for its sizeof. */
#define COMMAND_RUN(command, kept, text, ...)                                                      \
  command_run(command, (const char *const[]){__VA_ARGS__, NULL}, kept, text, sizeof(text))

#endif
