/* SPDX-License-Identifier: MIT */
/* Output files that appear whole or not at all. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "sh/base/output.h"

static supine_status output_fail(supine_output *output, supine_error *error, const char *what) {
  const int code = errno;
  (void)supine_error_set(error, SUPINE_ERROR_WRITE, "%s: %s: %s", output->path, what,
                         strerror(code)); /* NOLINT(concurrency-mt-unsafe) */
  supine_output_abandon(output);
  return SUPINE_ERROR_WRITE;
}

/* The mode a plain fopen would give; an existing file keeps its own. */
static mode_t output_mode(const struct stat *old) {
  if (old != NULL) {
    return old->st_mode & 0777;
  }
  const mode_t mask = umask(0);
  (void)umask(mask);
  return 0666 & ~mask;
}

supine_status supine_output_open(const char *path, supine_output *output, supine_error *error) {
  static const char suffix[] = ".part-XXXXXX";
  *output = (supine_output){0};
  const size_t length = strlen(path);
  output->path = malloc(length + 1);
  output->temporary = calloc(1, length + sizeof suffix);
  if (output->path == NULL || output->temporary == NULL) {
    supine_output_abandon(output);
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "%s: out of memory", path);
  }
  memcpy(output->path, path, length + 1);
  memcpy(output->temporary, path, length);
  memcpy(output->temporary + length, suffix, sizeof suffix);

  struct stat old = {0};
  const int exists = stat(path, &old) == 0;
  if (exists && S_ISDIR(old.st_mode)) {
    errno = EISDIR;
    return output_fail(output, error, "cannot write");
  }
  if (exists && !S_ISREG(old.st_mode)) { /* a device or pipe cannot be replaced: write into it */
    output->temporary[0] = '\0';
    output->file = fopen(path, "wb");
  } else {
    const int descriptor = mkstemp(output->temporary);
    if (descriptor < 0) {
      output->temporary[0] = '\0';
      return output_fail(output, error, "cannot create");
    }
    (void)fchmod(descriptor, output_mode(exists ? &old : NULL));
    output->file = fdopen(descriptor, "wb");
    if (output->file == NULL) {
      (void)close(descriptor);
    }
  }
  if (output->file == NULL) {
    return output_fail(output, error, "cannot create");
  }
  return SUPINE_OK;
}

supine_status supine_output_commit(supine_output *output, supine_error *error) {
  errno = 0;
  const int bad = ferror(output->file) != 0 || fflush(output->file) != 0;
  if (bad) {
    errno = errno == 0 ? EIO : errno;
    return output_fail(output, error, "cannot write");
  }
  FILE *file = output->file;
  output->file = NULL;
  if (fclose(file) != 0) {
    return output_fail(output, error, "cannot write");
  }
  if (output->temporary[0] != '\0' && rename(output->temporary, output->path) != 0) {
    return output_fail(output, error, "cannot replace");
  }
  output->temporary[0] = '\0';
  supine_output_abandon(output);
  return SUPINE_OK;
}

void supine_output_abandon(supine_output *output) {
  if (output->file != NULL) {
    (void)fclose(output->file);
  }
  if (output->temporary != NULL && output->temporary[0] != '\0') {
    (void)unlink(output->temporary);
  }
  free(output->temporary);
  free(output->path);
  *output = (supine_output){0};
}
