/* SPDX-License-Identifier: MIT */
/* Read a mesh file's bytes and find its format. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

#include "mesh/io/read.h"

enum { HEAD_SIZE = 4096 };

static supine_status cannot_read(const char *path, supine_error *error) {
  const int code = errno == 0 ? EIO : errno;
  return supine_error_set(error, SUPINE_ERROR_READ, "%s: cannot read: %s", path, strerror(code));
}

/* Find the ending with its dot; "" if the name has none. */
static const char *ending_of(const char *path) {
  const char *slash = strrchr(path, '/');
  const char *dot = strrchr(slash == NULL ? path : slash, '.');
  return dot == NULL ? "" : dot;
}

static bool format_of_ending(const char *ending, mesh_format *format) {
  static const struct {
    const char *ending;
    mesh_format format;
  } known[] = {{".ply", MESH_FORMAT_PLY},
               {".vtp", MESH_FORMAT_VTP},
               {".stl", MESH_FORMAT_STL},
               {".obj", MESH_FORMAT_OBJ}};
  for (size_t i = 0; i < sizeof known / sizeof *known; ++i) {
    if (strcasecmp(ending, known[i].ending) == 0) {
      *format = known[i].format;
      return true;
    }
  }
  *format = MESH_FORMAT_OTHER;
  return *ending != '\0' && supine_mesh_import_knows(ending);
}

/* Find the format by the first word, if that is unambiguous; for names without a known ending. */
static bool format_of_bytes(const unsigned char *bytes, size_t size, mesh_format *format) {
  mesh_text text = {bytes, bytes + size};
  mesh_text word;
  if (!supine_mesh_text_word(&text, &word)) {
    return false;
  }
  *format = supine_mesh_text_is(word, "ply")     ? MESH_FORMAT_PLY
            : supine_mesh_text_is(word, "solid") ? MESH_FORMAT_STL
                                                 : MESH_FORMAT_OTHER;
  return *format != MESH_FORMAT_OTHER;
}

static supine_status read_bytes(FILE *stream, size_t size, mesh_file *file, supine_error *error) {
  unsigned char *bytes = realloc(file->bytes, size + 1);
  if (bytes == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "%s: out of memory for %zu bytes",
                            file->path, size);
  }
  file->bytes = bytes;
  errno = 0;
  file->size += fread(bytes + file->size, 1, size - file->size, stream);
  bytes[file->size] = '\0';
  return ferror(stream) != 0 ? cannot_read(file->path, error) : SUPINE_OK;
}

static supine_status open_regular(const char *path, FILE **stream, size_t *size,
                                  supine_error *error) {
  struct stat about;
  errno = 0;
  if (stat(path, &about) != 0) {
    return cannot_read(path, error);
  }
  if (S_ISDIR(about.st_mode)) {
    return supine_error_set(error, SUPINE_ERROR_READ,
                            "%s: is a folder; give the mesh file inside it", path);
  }
  if (!S_ISREG(about.st_mode)) {
    return supine_error_set(error, SUPINE_ERROR_READ,
                            "%s: is not a regular file; save the mesh to one first", path);
  }
  *stream = fopen(path, "rb");
  if (*stream == NULL) {
    return cannot_read(path, error);
  }
  *size = (size_t)about.st_size;
  return *size == 0 ? supine_error_set(error, SUPINE_ERROR_FORMAT, "%s: the file is empty", path)
                    : SUPINE_OK;
}

supine_status supine_mesh_file_read(const char *path, mesh_file *file, supine_error *error) {
  *file = (mesh_file){.path = path};
  FILE *stream = NULL;
  size_t size = 0;
  supine_status status = open_regular(path, &stream, &size, error);
  if (status != SUPINE_OK) {
    goto cleanup;
  }
  status = read_bytes(stream, size < HEAD_SIZE ? size : HEAD_SIZE, file, error);
  if (status != SUPINE_OK) {
    goto cleanup;
  }
  supine_mesh_space_note(file, file->size);
  const char *ending = ending_of(path);
  if (!format_of_ending(ending, &file->format) &&
      !format_of_bytes(file->bytes, file->size, &file->format)) {
    status = supine_error_set(error, SUPINE_ERROR_FORMAT,
                              "%s: no importer for this ending; give the mesh as PLY, OBJ, STL or "
                              "VTP",
                              path);
    goto cleanup;
  }
  if (file->format != MESH_FORMAT_OTHER) {
    status = read_bytes(stream, size, file, error);
  }

cleanup:
  if (stream != NULL) {
    (void)fclose(stream);
  }
  if (status != SUPINE_OK) {
    supine_mesh_file_free(file);
  }
  return status;
}

void supine_mesh_file_free(mesh_file *file) {
  free(file->bytes);
  *file = (mesh_file){0};
}
