/* SPDX-License-Identifier: MIT */
/* Map files, allocate memory and write output files on Windows. */
#define WIN32_LEAN_AND_MEAN
#include <windows.h>

#include <io.h>
#include <malloc.h>
#include <share.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "base/output.h"
#include "runtime/safetensors/platform.h"

/* Convert a path from UTF-8 to UTF-16; the caller frees the result. Return NULL if the path is not
 * UTF-8 or if out of memory. */
static wchar_t *widen(const char *path) {
  const int length = MultiByteToWideChar(CP_UTF8, MB_ERR_INVALID_CHARS, path, -1, NULL, 0);
  wchar_t *wide = length > 0 ? malloc((size_t)length * sizeof *wide) : NULL;
  if (wide != NULL) {
    (void)MultiByteToWideChar(CP_UTF8, MB_ERR_INVALID_CHARS, path, -1, wide, length);
  }
  return wide;
}

/* Map a file. The mapping stays valid after the handles are closed. */
static const void *map_handle(HANDLE handle) {
  HANDLE mapping = CreateFileMappingW(handle, NULL, PAGE_READONLY, 0, 0, NULL);
  const void *bytes = mapping != NULL ? MapViewOfFile(mapping, FILE_MAP_READ, 0, 0, 0) : NULL;
  if (mapping != NULL) {
    (void)CloseHandle(mapping);
  }
  return bytes;
}

supine_status supine_safetensors_platform_map(const char *path,
                                              supine_safetensors_platform_file *file,
                                              supine_error *error) {
  supine_status status = SUPINE_OK;
  LARGE_INTEGER size = {.QuadPart = 0};
  wchar_t *wide = widen(path);
  *file = (supine_safetensors_platform_file){NULL, 0};
  HANDLE handle = wide == NULL ? INVALID_HANDLE_VALUE
                               : CreateFileW(wide, GENERIC_READ, FILE_SHARE_READ, NULL,
                                             OPEN_EXISTING, FILE_ATTRIBUTE_NORMAL, NULL);
  free(wide);
  if (handle == INVALID_HANDLE_VALUE || !GetFileSizeEx(handle, &size) ||
      GetFileType(handle) != FILE_TYPE_DISK) {
    status = supine_error_set(error, SUPINE_ERROR_READ, "%s: cannot read: Windows error %lu", path,
                              (unsigned long)GetLastError());
  } else if (size.QuadPart > 0) { /* do not map an empty file: mapping would fail */
    file->bytes = (uint64_t)size.QuadPart <= SIZE_MAX ? map_handle(handle) : NULL;
    file->size = (size_t)size.QuadPart;
    if (file->bytes == NULL) {
      file->size = 0;
      status = supine_error_set(error, SUPINE_ERROR_READ,
                                "%s: cannot map the file into memory: Windows error %lu", path,
                                (unsigned long)GetLastError());
    }
  }
  if (handle != INVALID_HANDLE_VALUE) {
    (void)CloseHandle(handle);
  }
  return status;
}

void supine_safetensors_platform_unmap(const supine_safetensors_platform_file *file) {
  if (file->bytes != NULL) {
    (void)UnmapViewOfFile(file->bytes);
  }
}

void *supine_safetensors_platform_allocate(size_t bytes) {
  enum { LINE = 64 };
  return _aligned_malloc(bytes > 0 ? bytes : 1, LINE);
}

void supine_safetensors_platform_free(void *memory) {
  _aligned_free(memory);
}

/* Write to a file beside the target, which no other process can open for writing. */
supine_status supine_output_open(const char *path, supine_output *output, supine_error *error) {
  const size_t size = strlen(path) + sizeof ".part";
  *output = (supine_output){.path = _strdup(path), .temporary = malloc(size)};
  if (output->path != NULL && output->temporary != NULL) {
    (void)snprintf(output->temporary, size, "%s.part", path);
    wchar_t *wide = widen(output->temporary);
    output->file = wide != NULL ? _wfsopen(wide, L"wb", _SH_DENYWR) : NULL;
    free(wide);
  }
  if (output->file == NULL) {
    free(output->path);
    free(output->temporary);
    return supine_error_set(error, SUPINE_ERROR_WRITE, "%s: cannot write: Windows error %lu", path,
                            (unsigned long)GetLastError());
  }
  return SUPINE_OK;
}

supine_status supine_output_commit(supine_output *output, supine_error *error) {
  wchar_t *from = widen(output->temporary);
  wchar_t *to = widen(output->path);
  bool done =
      fflush(output->file) == 0 && ferror(output->file) == 0 && _commit(_fileno(output->file)) == 0;
  (void)fclose(output->file);
  done = done && from != NULL && to != NULL &&
         MoveFileExW(from, to, MOVEFILE_REPLACE_EXISTING | MOVEFILE_WRITE_THROUGH);
  if (!done) {
    (void)supine_error_set(error, SUPINE_ERROR_WRITE, "%s: cannot write: Windows error %lu",
                           output->path, (unsigned long)GetLastError());
    if (from != NULL) {
      (void)DeleteFileW(from);
    }
  }
  free(from);
  free(to);
  free(output->path);
  free(output->temporary);
  return done ? SUPINE_OK : SUPINE_ERROR_WRITE;
}
