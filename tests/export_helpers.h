/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Runs supine export on made bases. Include after cmocka. */
#ifndef SUPINE_TEST_EXPORT_HELPERS_H
#define SUPINE_TEST_EXPORT_HELPERS_H

#include "test.h"

#include <unistd.h>

#include "program/options/command.h"
#include "runtime_fixture.h"

/* Runs the command with standard output and error in a file, which `text` then holds. */
static inline int export_run(const char *folder, char text[8192], const char *const *words) {
  char *argv[24] = {strdup("export")};
  char path[256];
  int argc = 1;
  for (; words[argc - 1] != NULL; ++argc) {
    argv[argc] = strdup(words[argc - 1]);
  }
  (void)snprintf(path, sizeof path, "%s/printed", folder);
  (void)fflush(stdout);
  (void)fflush(stderr);
  const int out = dup(STDOUT_FILENO);
  const int err = dup(STDERR_FILENO);
  FILE *file = fopen(path, "w+b");
  assert_non_null(file);
  assert_true(dup2(fileno(file), STDOUT_FILENO) >= 0 && dup2(fileno(file), STDERR_FILENO) >= 0);
  optind = 0; /* getopt starts anew */
  const int code = supine_options_run(&supine_command_export, argc, argv);
  (void)fflush(stdout);
  (void)fflush(stderr);
  assert_true(dup2(out, STDOUT_FILENO) >= 0 && dup2(err, STDERR_FILENO) >= 0);
  (void)close(out);
  (void)close(err);
  rewind(file);
  text[fread(text, 1, 8191, file)] = '\0';
  (void)fclose(file);
  for (int i = 0; i < argc; ++i) {
    free(argv[i]);
  }
  return code;
}

#define EXPORT_RUN(folder, text, ...)                                                              \
  export_run(folder, text, (const char *const[]){__VA_ARGS__, NULL})

/* Writes a made basis as `folder`/`name`; the path into `path`. */
static inline void export_basis_make(const char *folder, const char *name, size_t modes,
                                     size_t band, bool vector, bool closed, char path[256]) {
  fixture *f = fixture_create(40, modes, band, 2, vector, closed, 5, 4711 + modes);
  (void)snprintf(path, 256, "%s/%s", folder, name);
  fixture_write(f, path);
  fixture_destroy(f);
}

#endif
