/* SPDX-License-Identifier: MIT */
/* Open regular files to read. */
#include <errno.h>
#include <fcntl.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/arena.h"
#include "base/input.h"
#include "base/output.h"
#include "base/text.h"

static void free_path(char **path) {
  free(*path);
}

static supine_status cannot_read(const char *path, supine_error *error) {
  return supine_error_set(error, SUPINE_ERROR_READ, "%s: cannot read: %s", path, strerror(errno));
}

static supine_status not_regular(const char *path, supine_error *error) {
  return supine_error_set(error, SUPINE_ERROR_READ,
                          "%s: not a regular file; save the data to a file first", path);
}

/* Open a regular file. Anything else is refused before it is opened, because opening a pipe waits
 * for a writer, and opening a device may change it. The type is checked again afterwards, as the
 * file may have been replaced. */
static supine_status open_regular(const char *path, int flags, FILE **file, size_t *size,
                                  supine_error *error) {
  struct stat about = {0};
  if (stat(path, &about) != 0) {
    return cannot_read(path, error);
  }
  SUPINE_REFUSE_IF(S_ISDIR(about.st_mode), error, SUPINE_ERROR_READ,
                   "%s: is a folder, not a regular file; give the file inside it", path);
  if (!S_ISREG(about.st_mode)) {
    return not_regular(path, error);
  }
  const int descriptor = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK | flags);
  if (descriptor < 0) {
    return cannot_read(path, error);
  }
  *file = fdopen(descriptor, "rb");
  if (*file == NULL) {
    (void)close(descriptor);
    return supine_error_memory(error, "reading %s", path);
  }
  const bool known = fstat(descriptor, &about) == 0;
  if (!known || !S_ISREG(about.st_mode)) {
    const supine_status status = known ? not_regular(path, error) : cannot_read(path, error);
    supine_file_close(file);
    *file = NULL;
    return status;
  }
  *size = (size_t)about.st_size;
  return SUPINE_OK;
}

supine_status supine_input_open(const char *path, FILE **file, size_t *size, supine_error *error) {
  return open_regular(path, 0, file, size, error);
}

/* Copy the beginning of a name from a file for a message of one line. */
static void make_shown(const char *name, char shown[96]) {
  (void)snprintf(shown, 96, "%s", name);
  for (char *c = supine_text_make_utf8(shown); *c != '\0'; ++c) {
    if ((unsigned char)*c < ' ' || *c == '\x7F') {
      *c = '?';
    }
  }
}

supine_status supine_input_open_beside(const char *path, const char *name, FILE **file,
                                       size_t *size, supine_error *error) {
  const char *plain = strncmp(name, "./", 2) == 0 ? name + 2 : name;
  char shown[96];
  make_shown(name, shown);
  SUPINE_REFUSE_IF(*plain == '\0' || strchr(plain, '/') != NULL, error, SUPINE_ERROR_FORMAT,
                   "%s: it refers to the file \"%s\" in another folder; save it as one file", path,
                   shown);
  SUPINE_FREED_BY(free_path) char *named = supine_path_beside(path, plain);
  SUPINE_FREED_BY(free_path) char *beside = supine_path_beside(path, ".");
  if (named == NULL || beside == NULL) {
    return supine_error_memory(error, "a file that %s names", path);
  }
  SUPINE_FREED_BY(free_path) char *folder = realpath(beside, NULL);
  SUPINE_FREED_BY(free_path) char *target = realpath(named, NULL);
  SUPINE_REFUSE_IF(folder == NULL || target == NULL, error, SUPINE_ERROR_READ,
                   "%s: it refers to the file \"%s\", which cannot be read: %s", path, shown,
                   strerror(errno));
  SUPINE_FREED_BY(free_path) char *beside_target = supine_path_beside(target, ".");
  if (beside_target == NULL) {
    return supine_error_memory(error, "a file that %s names", path);
  }
  SUPINE_FREED_BY(free_path) char *target_folder = realpath(beside_target, NULL);
  const bool inside = target_folder != NULL && strcmp(target_folder, folder) == 0;
  SUPINE_REFUSE_IF(!inside, error, SUPINE_ERROR_FORMAT,
                   "%s: it refers to the file \"%s\", a link to another folder; copy the file here",
                   path, shown);
  struct stat about = {0};
  const bool exists = stat(target, &about) == 0;
  SUPINE_REFUSE_IF(!exists || !S_ISREG(about.st_mode), error, SUPINE_ERROR_FORMAT,
                   "%s: it refers to \"%s\", which is not a regular file; save it as one file",
                   path, shown);
  return open_regular(target, O_NOFOLLOW, file, size, error);
}
