/* SPDX-License-Identifier: MIT */
/** @file
 * What differs between operating systems: a file as memory, and large memory. */
#ifndef SUPINE_PLATFORM_H
#define SUPINE_PLATFORM_H

#include <stddef.h>

#include <supine/status.h>

/** A file's bytes, read-only and shared with other processes that read it. */
typedef struct supine_platform_file {
  const void *bytes; /**< NULL where the file is empty */
  size_t size;
} supine_platform_file;

/** Maps a file.
 * @param path  UTF-8
 * @retval SUPINE_ERROR_READ  missing, unreadable, or no file */
supine_status supine_platform_map(const char *path, supine_platform_file *file,
                                  supine_error *error);
/** Gives it back; legal on a zeroed struct. */
void supine_platform_unmap(const supine_platform_file *file);

/** Memory aligned to lines of the cache, not zeroed; in huge pages where it fills some and the
 * system has them. NULL: none is left. */
void *supine_platform_allocate(size_t bytes);
/** Gives that back; NULL is legal. */
void supine_platform_free(void *memory);

#endif
