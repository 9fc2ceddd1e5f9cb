/* SPDX-License-Identifier: MIT */
/* Write output files whole or not at all. */
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/output.h"

enum {
  NAMES_MAX = 16,  /* largest number of temporary files that supine_output_abandon_all removes */
  BUFFER = 1 << 18 /* size of the buffer of an output in bytes */
};

/* Descriptor of the original standard output; -1 before supine_output_take_standard. */
static atomic_int standard_output = -1;

bool supine_output_is_standard(const char *path) {
  return path[0] == '-' && (path[1] == '\0' || path[1] == '.') && strchr(path, '/') == NULL;
}

bool supine_output_take_standard(void) {
  const int flags = fcntl(STDOUT_FILENO, F_GETFL);
  if (flags < 0 || (flags & O_ACCMODE) == O_RDONLY) {
    return false;
  }
  (void)fflush(stdout);
  if (atomic_load(&standard_output) < 0) {
    atomic_store(&standard_output, fcntl(STDOUT_FILENO, F_DUPFD_CLOEXEC, STDERR_FILENO + 1));
  }
  return atomic_load(&standard_output) >= 0 && dup2(STDERR_FILENO, STDOUT_FILENO) >= 0;
}

/* Names of temporary files that exist or are about to; NULL in free entries. */
static char *_Atomic temporary_names[NAMES_MAX];

/* Replace one entry of `temporary_names` that equals `from` by `to`. */
static void replace_name(char *from, char *to) {
  for (int i = 0; i < NAMES_MAX; ++i) {
    char *expected = from;
    if (atomic_compare_exchange_strong(&temporary_names[i], &expected, to)) {
      return;
    }
  }
}

void supine_output_abandon_all(void) {
  for (int i = 0; i < NAMES_MAX; ++i) {
    const char *name = atomic_load(&temporary_names[i]);
    if (name != NULL) {
      (void)unlink(name);
    }
  }
}

static supine_status output_fail(supine_output *output, supine_error *error, const char *what) {
  const int code = errno;
  const char *const name = output->standard ? "standard output" : output->path;
  (void)supine_error_set(error, SUPINE_ERROR_WRITE, "%s: %s: %s", name, what, strerror(code));
  supine_output_abandon(output);
  return SUPINE_ERROR_WRITE;
}

char *supine_path_beside(const char *path, const char *name) {
  const char *slash = name[0] == '/' ? NULL : strrchr(path, '/');
  const size_t stem = slash == NULL ? 0 : (size_t)(slash - path) + 1;
  char *made = malloc(stem + strlen(name) + 1);
  if (made != NULL) {
    memcpy(made, path, stem);
    memcpy(made + stem, name, strlen(name) + 1);
  }
  return made;
}

/* If the last part of a path is a symbolic link, replace it by the target, which need not exist. */
static char *follow_links(const char *path) {
  enum { LINKS_MAX = 40 }; /* largest number of links that Linux follows */
  char *at = strdup(path);
  for (int i = 0; at != NULL && i < LINKS_MAX; ++i) {
    char link[PATH_MAX];
    const ssize_t length = readlink(at, link, sizeof link - 1);
    if (length < 0) {
      break;
    }
    link[length] = '\0';
    char *next = supine_path_beside(at, link);
    free(at);
    at = next;
  }
  return at;
}

/* Create a file with a unique temporary name beside the target. Return its descriptor, or -1 and
 * set errno. */
static int open_temporary(supine_output *output) {
  enum { TRIES = 100, ENDING = 64 };
  static atomic_uint counter;
  const size_t size = strlen(output->target) + ENDING;
  output->temporary = malloc(size);
  if (output->temporary != NULL) {
    for (int i = 0; i < TRIES; ++i) {
      (void)snprintf(output->temporary, size, "%s.part-%ld-%u", output->target, (long)getpid(),
                     atomic_fetch_add(&counter, 1));
      replace_name(NULL, output->temporary); /* before the file exists: a signal may come at once */
      const int descriptor = open(output->temporary, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
      if (descriptor >= 0) {
        return descriptor;
      }
      replace_name(output->temporary, NULL);
      if (errno != EEXIST) {
        break;
      }
    }
  }
  free(output->temporary);
  output->temporary = NULL;
  return -1;
}

static int open_descriptor(supine_output *output) {
  struct stat old;
  if (output->standard) {
    const int kept = atomic_load(&standard_output);
    return fcntl(kept >= 0 ? kept : STDOUT_FILENO, F_DUPFD_CLOEXEC, STDERR_FILENO + 1);
  }
  if (stat(output->target, &old) != 0) {
    return open_temporary(output);
  }
  if (S_ISDIR(old.st_mode)) {
    errno = EISDIR;
    return -1;
  }
  if (!S_ISREG(old.st_mode)) { /* a device or pipe cannot be replaced: write into it */
    return open(output->target, O_WRONLY | O_CLOEXEC);
  }
  if ((old.st_mode & 0222) == 0) {
    errno = EACCES;
    return -1;
  }
  const int descriptor = open_temporary(output);
  if (descriptor >= 0) {
    (void)fchmod(descriptor, old.st_mode & 0777);
  }
  return descriptor;
}

supine_status supine_output_open(const char *path, supine_output *output, supine_error *error) {
  *output = (supine_output){0};
  output->standard = supine_output_is_standard(path);
  output->path = strdup(path);
  output->target = follow_links(path);
  if (output->path == NULL || output->target == NULL) {
    supine_output_abandon(output);
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "%s: out of memory", path);
  }
  const int descriptor = open_descriptor(output);
  if (descriptor < 0) {
    return output_fail(output, error, "cannot write");
  }
  output->file = fdopen(descriptor, "wb");
  if (output->file == NULL || setvbuf(output->file, NULL, _IOFBF, BUFFER) != 0) {
    if (output->file == NULL) {
      (void)close(descriptor);
    }
    supine_output_abandon(output);
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "%s: out of memory", path);
  }
  return SUPINE_OK;
}

/* Wait until the file's entry in its folder is on the disk, if the file system supports that. */
static void sync_folder(const char *target) {
  char *folder = supine_path_beside(target, ".");
  const int descriptor = folder != NULL ? open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC) : -1;
  if (descriptor >= 0) {
    (void)fsync(descriptor);
    (void)close(descriptor);
  }
  free(folder);
}

supine_status supine_output_commit(supine_output *output, supine_error *error) {
  const int descriptor = fileno(output->file);
  struct stat made = {0};
  const bool flushed = fflush(output->file) == 0 && ferror(output->file) == 0;
  if (!flushed) { /* errno of the failed write may be lost: write again to set it */
    errno = write(descriptor, "", 1) == 1 ? EIO : errno;
    return output_fail(output, error, "cannot write");
  }
  const bool known = fstat(descriptor, &made) == 0;
  const bool regular = known && S_ISREG(made.st_mode) && !output->standard;
  if (!known || (regular && fsync(descriptor) != 0)) {
    return output_fail(output, error, "cannot write");
  }
  if (regular) {
    if (rename(output->temporary, output->target) != 0) {
      return output_fail(output, error, "cannot replace");
    }
    replace_name(output->temporary, NULL);
    output->temporary[0] = '\0'; /* the file was renamed: do not remove it */
    sync_folder(output->target);
  }
  supine_output_abandon(output);
  return SUPINE_OK;
}

void supine_output_abandon(supine_output *output) {
  if (output->temporary != NULL && output->temporary[0] != '\0') {
    (void)unlink(output->temporary);
    replace_name(output->temporary, NULL);
  }
  if (output->file != NULL) {
    /* keep fclose from writing the rest of the buffer into a pipe */
    const int nowhere = open("/dev/null", O_WRONLY | O_CLOEXEC);
    (void)dup2(nowhere, fileno(output->file));
    (void)close(nowhere);
    (void)fclose(output->file);
  }
  free(output->temporary);
  free(output->target);
  free(output->path);
  *output = (supine_output){0};
}

supine_status supine_output_try(const char *path, supine_error *error) {
  supine_output output;
  struct stat old;
  if (supine_output_is_standard(path) || (stat(path, &old) == 0 && S_ISFIFO(old.st_mode))) {
    return SUPINE_OK; /* do not close a pipe: its reader would take the output as complete */
  }
  const supine_status status = supine_output_open(path, &output, error);
  supine_output_abandon(&output);
  return status;
}
