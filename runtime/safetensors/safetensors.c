/* SPDX-License-Identifier: MIT */
/* Safetensors files: mapping them, and asking what they hold. */
#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include "runtime/safetensors/checksum.h"
#include "runtime/safetensors/safetensors_file.h"

/* Takes the bytes, mapped or not, whatever comes of it. */
static supine_status open_bytes(const void *bytes, size_t size, void *mapping, const char *name,
                                supine_safetensors **result, supine_error *error) {
  supine_status status = SUPINE_ERROR_MEMORY;
  supine_safetensors *file = calloc(1, sizeof *file);
  char *copy = strdup(name);
  if (file == NULL || copy == NULL) {
    (void)supine_error_set(error, status, "%s: out of memory", name);
    if (mapping != NULL) {
      (void)munmap(mapping, size);
    }
    free(copy);
    goto cleanup;
  }
  *file = (supine_safetensors){
      .name = copy, .bytes = bytes, .size = size, .mapping = mapping, .error = error};
  status = supine_safetensors_parse(file);
  free(file->entries);
  file->entries = NULL;
  file->error = NULL;

cleanup:
  if (status != SUPINE_OK) {
    supine_safetensors_close(file);
    file = NULL;
  }
  *result = file;
  return status;
}

supine_status supine_safetensors_open_memory(const void *bytes, size_t size, const char *name,
                                             supine_safetensors **file, supine_error *error) {
  return open_bytes(bytes, size, NULL, name, file, error);
}

supine_status supine_safetensors_open(const char *path, supine_safetensors **file,
                                      supine_error *error) {
  supine_status status = SUPINE_ERROR_READ;
  struct stat about = {0};
  *file = NULL;
  const int descriptor = open(path, O_RDONLY | O_CLOEXEC);
  if (descriptor < 0 || fstat(descriptor, &about) != 0) {
    (void)supine_error_set(error, status, "%s: cannot read: %s", path,
                           strerror(errno)); /* NOLINT(concurrency-mt-unsafe) */
    goto cleanup;
  }
  if (!S_ISREG(about.st_mode)) {
    (void)supine_error_set(error, status, "%s: not a file: give a basis file's path", path);
    goto cleanup;
  }
  const size_t size = (size_t)about.st_size;
  if (size == 0) { /* nothing to map */
    status = open_bytes("", 0, NULL, path, file, error);
    goto cleanup;
  }
  void *bytes = mmap(NULL, size, PROT_READ, MAP_PRIVATE, descriptor, 0);
  if (bytes == MAP_FAILED) {
    (void)supine_error_set(error, status, "%s: cannot map: %s", path,
                           strerror(errno)); /* NOLINT(concurrency-mt-unsafe) */
    goto cleanup;
  }
  status = open_bytes(bytes, size, bytes, path, file, error);

cleanup:
  if (descriptor >= 0) {
    (void)close(descriptor);
  }
  return status;
}

void supine_safetensors_close(supine_safetensors *file) {
  if (file == NULL) {
    return;
  }
  if (file->mapping != NULL) {
    (void)munmap(file->mapping, file->size);
  }
  for (size_t i = 0; file->copies != NULL && i < file->tensor_count; ++i) {
    free(file->copies[i]);
  }
  free(file->copies);
  free(file->tensors);
  free(file->metadata);
  free(file->entries);
  free(file->header);
  free(file->name);
  free(file);
}

const supine_tensor *supine_safetensors_find(const supine_safetensors *file, const char *name) {
  for (size_t i = 0; i < file->tensor_count; ++i) {
    if (strcmp(file->tensors[i].name, name) == 0) {
      return &file->tensors[i];
    }
  }
  return NULL;
}

const char *supine_safetensors_metadata(const supine_safetensors *file, const char *key) {
  for (size_t i = 0; i < file->metadata_count; ++i) {
    if (strcmp(file->metadata[i].key, key) == 0) {
      return file->metadata[i].value;
    }
  }
  return NULL;
}

const supine_metadata *supine_safetensors_all_metadata(const supine_safetensors *file,
                                                       size_t *count) {
  *count = file->metadata_count;
  return file->metadata;
}

supine_status supine_safetensors_verify(const supine_safetensors *file, supine_error *error) {
  const char *stated = supine_safetensors_metadata(file, "checksum");
  if (stated == NULL) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT, "%s: no checksum: not written by Supine",
                            file->name);
  }
  char found[CHECKSUM_SIZE];
  supine_safetensors_checksum_text(stated, file->tensors, file->tensor_count, file->metadata,
                                   file->metadata_count, found);
  return strcmp(stated, found) == 0
             ? SUPINE_OK
             : supine_error_set(error, SUPINE_ERROR_FORMAT,
                                "%s: corrupted: its checksum is %s, it states %.32s", file->name,
                                found, stated);
}
