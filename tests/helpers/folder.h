/* SPDX-License-Identifier: GPL-3.0-or-later */
/* A temporary folder for the tests of one program. */
#ifndef SUPINE_TEST_FOLDER_H
#define SUPINE_TEST_FOLDER_H

#include "tests/helpers/test.h"

static char folder[] = "/tmp/supine-test-XXXXXX";

/* Make the folder before the first test. */
static inline int folder_make(void **state) {
  (void)state;
  return mkdtemp(folder) != NULL ? 0 : -1;
}

/* Remove the folder and its content after the last test. */
static inline int folder_remove(void **state) {
  char command[64];
  (void)state;
  (void)snprintf(command, sizeof command, "rm -r %s", folder);
  return system(command); /* NOLINT(cert-env33-c) */
}

/* Return the path of a file in the temporary folder. It stays valid during the next seven calls. */
static inline const char *in_folder(const char *name) {
  static char path[8][128];
  static size_t next;
  next = (next + 1) % 8;
  (void)snprintf(path[next], sizeof path[next], "%s/%s", folder, name);
  return path[next];
}

#endif
