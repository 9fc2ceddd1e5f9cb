/* SPDX-License-Identifier: MIT */
/* Opening safetensors files, and checking them against their checksum. */
#include <stdlib.h>
#include <string.h>

#include "runtime/safetensors/checksum.h"
#include "runtime/safetensors/safetensors_file.h"

static char *copy_text(const char *text) {
  const size_t size = strlen(text) + 1;
  char *copy = malloc(size);
  if (copy != NULL) {
    memcpy(copy, text, size);
  }
  return copy;
}

/* Takes the mapping, if there is one, whatever comes of it. */
static supine_status open_bytes(const void *bytes, size_t size, supine_platform_file mapping,
                                const char *name, supine_safetensors **result,
                                supine_error *error) {
  supine_status status = SUPINE_ERROR_MEMORY;
  supine_safetensors *file = calloc(1, sizeof *file);
  char *copy = copy_text(name);
  if (file == NULL || copy == NULL) {
    (void)supine_error_set(error, status, "%s: out of memory", name);
    supine_platform_unmap(&mapping);
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
  return open_bytes(bytes, size, (supine_platform_file){NULL, 0}, name, file, error);
}

supine_status supine_safetensors_open(const char *path, supine_safetensors **file,
                                      supine_error *error) {
  supine_platform_file mapping;
  *file = NULL;
  const supine_status status = supine_platform_map(path, &mapping, error);
  return status != SUPINE_OK ? status
                             : open_bytes(mapping.bytes == NULL ? "" : mapping.bytes, mapping.size,
                                          mapping, path, file, error);
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
