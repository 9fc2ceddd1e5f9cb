/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Run the program in a temporary folder. */
#ifndef SUPINE_PROGRAM_HELPERS_H
#define SUPINE_PROGRAM_HELPERS_H

#include "tests/helpers/folder.h"

#include <dirent.h>
#include <sys/wait.h>

#include <supine/status.h>

static char printed[65536]; /* output of the last run on stdout and stderr together */

/* Run "supine ARGUMENTS" in the temporary folder. Return its exit code, or -1 if a signal or the
 * time limit ended it. */
SUPINE_PRINTF(1, 2)
static int run(const char *format, ...) {
  char arguments[2048];
  char command[4096];
  va_list list;
  va_start(list, format);
  (void)vsnprintf(arguments, sizeof arguments, format, list);
  va_end(list);
  (void)snprintf(command, sizeof command, "cd %s && timeout 100 \"%s\" %s 2>&1", folder,
                 SUPINE_PROGRAM, arguments);
  FILE *pipe = popen(command, "r"); /* NOLINT(cert-env33-c): the program under test */
  assert_non_null(pipe);
  printed[fread(printed, 1, sizeof printed - 1, pipe)] = '\0';
  const int status = pclose(pipe);
  return WIFEXITED(status) && WEXITSTATUS(status) < 124 ? WEXITSTATUS(status) : -1;
}

static void expect(int code, const char *words, int got) {
  if (got != code) {
    fail_msg("exit code %d instead of %d: %s", got, code, printed);
  }
  assert_says(printed, words);
}

/* Run "supine ARGUMENTS", and assert its exit code and that its output contains `words`. */
#define EXPECT(code, words, ...) expect(code, words, run(__VA_ARGS__))

/* Count the files in the temporary folder whose names begin with `prefix`. */
static inline size_t count_files(const char *prefix) {
  size_t count = 0;
  DIR *entries = opendir(folder);
  assert_non_null(entries);
  for (const struct dirent *entry; (entry = readdir(entries)) != NULL;) {
    count += strncmp(entry->d_name, prefix, strlen(prefix)) == 0 ? 1 : 0;
  }
  (void)closedir(entries);
  return count;
}

#endif
