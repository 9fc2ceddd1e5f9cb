/* SPDX-License-Identifier: MIT */
/* Write output folders whole or not at all. */
#include <dirent.h>
#include <errno.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "sh/base/folder.h"

static supine_status fail(const char *path, const char *what, supine_error *error) {
  const int code = errno;
  return supine_error_set(error, SUPINE_ERROR_WRITE, "%s: %s: %s", path, what, strerror(code));
}

/* Remove a folder of files as far as possible. */
static void remove_folder(const char *path) {
  DIR *entries = opendir(path);
  if (entries != NULL) {
    const struct dirent *entry;
    while ((entry = readdir(entries)) != NULL) {
      (void)unlinkat(dirfd(entries), entry->d_name, 0); /* fails for "." and "..", which are
                                                         * folders */
    }
    (void)closedir(entries);
  }
  (void)rmdir(path);
}

static supine_status is_free(const char *path, supine_error *error) {
  DIR *entries = opendir(path);
  if (entries == NULL) {
    return errno == ENOENT ? SUPINE_OK : fail(path, "cannot use this name for a folder", error);
  }
  size_t count = 0;
  while (readdir(entries) != NULL) {
    ++count;
  }
  (void)closedir(entries);
  return count <= 2
             ? SUPINE_OK
             : supine_error_set(error, SUPINE_ERROR_WRITE,
                                "%s: this folder is not empty: remove it, or choose another name",
                                path);
}

/* Messages to the keeper, one byte each: the folder is being renamed; it is to be kept. The
 * pipe's end means that this process ended. */
enum { GROWING, NAMED, KEPT };

/* Run the keeper, outside this process's group so that signals to the group do not end it. */
static _Noreturn void keep_watch(const supine_folder *folder, int line) {
  static const int numbers[] = {SIGINT, SIGTERM, SIGHUP, SIGPIPE};
  for (size_t i = 0; i < sizeof numbers / sizeof *numbers; ++i) {
    (void)signal(numbers[i], SIG_IGN);
  }
  (void)setsid();
  int told = GROWING;
  char byte = 0;
  if (write(line, &byte, 1) == 1) { /* ready */
    ssize_t got;
    while ((got = read(line, &byte, 1)) == 1 || (got < 0 && errno == EINTR)) {
      told += got == 1;
    }
  }
  if (access(folder->temporary, F_OK) == 0) { /* it was never renamed */
    remove_folder(folder->temporary);
  } else if (told == NAMED) {
    remove_folder(folder->path);
    if (folder->index != NULL) {
      (void)unlink(folder->index);
    }
  }
  _exit(0);
}

/* Start the keeper and wait until it is ready; false sets errno. */
static bool begin_keeper(supine_folder *folder) {
  int ends[2];
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) {
    return false;
  }
  folder->keeper = fork();
  if (folder->keeper == 0) {
    (void)close(ends[0]);
    keep_watch(folder, ends[1]);
  }
  (void)close(ends[1]);
  folder->line = ends[0];
  char byte;
  ssize_t got = -1;
  while (folder->keeper > 0 && (got = read(ends[0], &byte, 1)) < 0 && errno == EINTR) {
  }
  return got == 1;
}

static void tell_keeper(const supine_folder *folder) {
  const char byte = 0;
  while (send(folder->line, &byte, 1, MSG_NOSIGNAL) < 0 && errno == EINTR) {
  }
}

supine_status supine_folder_open(const char *path, const char *index, supine_folder *folder,
                                 supine_error *error) {
  static const char ending[] = ".part-0123456789abcdef";
  unsigned long long number = 0; /* for a unique name */
  (void)!getrandom(&number, sizeof number, 0);
  *folder = (supine_folder){0};
  folder->path = strdup(path);
  folder->index = index == NULL ? NULL : strdup(index);
  folder->temporary = malloc(strlen(path) + sizeof ending);
  if (folder->path == NULL || (index != NULL && folder->index == NULL) ||
      folder->temporary == NULL) {
    supine_folder_close(folder);
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "%s: out of memory", path);
  }
  size_t length = strlen(path);
  while (length > 1 && path[length - 1] == '/') {
    --length;
  }
  folder->path[length] = '\0';
  (void)snprintf(folder->temporary, length + sizeof ending, "%s.part-%llx", folder->path, number);
  supine_status status = is_free(folder->path, error);
  if (status == SUPINE_OK && (!begin_keeper(folder) || mkdir(folder->temporary, 0777) != 0)) {
    status = fail(path, "cannot create its folder", error);
  }
  if (status != SUPINE_OK) {
    supine_folder_close(folder);
  }
  return status;
}

supine_status supine_folder_rename(supine_folder *folder, supine_error *error) {
  tell_keeper(folder);
  folder->named = rename(folder->temporary, folder->path) == 0;
  return folder->named ? SUPINE_OK : fail(folder->path, "cannot give the folder its name", error);
}

void supine_folder_keep(supine_folder *folder) {
  folder->named = false;
  tell_keeper(folder);
}

void supine_folder_close(supine_folder *folder) {
  if (folder->named) { /* the index was not written: keep an older one of that name */
    (void)rename(folder->path, folder->temporary);
  }
  if (folder->keeper != 0) {
    (void)close(folder->line);
    while (folder->keeper > 0 && waitpid(folder->keeper, NULL, 0) < 0 && errno == EINTR) {
    }
  }
  free(folder->path);
  free(folder->index);
  free(folder->temporary);
  *folder = (supine_folder){0};
}
