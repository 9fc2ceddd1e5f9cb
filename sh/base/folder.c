/* SPDX-License-Identifier: MIT */
/* Output folders that appear whole or not at all. */
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

/* Removes a folder of files, as far as it can. */
static void remove_folder(const char *path) {
  DIR *entries = opendir(path);
  if (entries != NULL) {
    const struct dirent *entry;
    while ((entry = readdir(entries)) != NULL) {
      (void)unlinkat(dirfd(entries), entry->d_name, 0); /* not "." and "..", which are folders */
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
  return count <= 2 ? SUPINE_OK
                    : supine_error_set(error, SUPINE_ERROR_WRITE,
                                       "%s: there is something in this folder already: remove it, "
                                       "or choose another name",
                                       path);
}

/* What the keeper is told, each by one byte: the folder takes its name now; it is to stay. Then, or
 * before, the line ends, because this process did. */
enum { GROWING, NAMED, KEPT };

/* The keeper's life. Out of this process's group, so that what is sent to all of it does not end
 * the keeper as well. */
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
  if (access(folder->temporary, F_OK) == 0) { /* it never took its name */
    remove_folder(folder->temporary);
  } else if (told == NAMED) {
    remove_folder(folder->path);
    if (folder->index != NULL) {
      (void)unlink(folder->index);
    }
  }
  _exit(0);
}

/* Starts the keeper and waits until it is ready; false and errno. */
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
  unsigned long long number = 0; /* a name that nobody else has */
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
  if (folder->named) { /* the index was not written: an old one of its name is not to go */
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
