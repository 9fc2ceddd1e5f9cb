/* SPDX-License-Identifier: MIT */
/** @file
 * Functions that differ between operating systems: mapping files and allocating large memory. */
#ifndef SUPINE_PLATFORM_H
#define SUPINE_PLATFORM_H

#include <stddef.h>

#include <supine/status.h>

/** The bytes of a mapped file, read-only and shared with other processes that map it. */
typedef struct supine_safetensors_platform_file {
  const void *bytes; /**< NULL if the file is empty */
  size_t size;
} supine_safetensors_platform_file;

/** Map a file into memory.
 * @param path  in UTF-8
 * @param file  written; empty on failure */
supine_status supine_safetensors_platform_map(const char *path,
                                              supine_safetensors_platform_file *file,
                                              supine_error *error);
/** Unmap a file; legal on a zeroed struct. */
void supine_safetensors_platform_unmap(const supine_safetensors_platform_file *file);

/** Allocate memory, aligned to cache lines and not zeroed, in huge pages if it is large enough and
 * the system has them. Return NULL if out of memory. */
void *supine_safetensors_platform_allocate(size_t bytes);
/** Free memory of supine_safetensors_platform_allocate; NULL is legal. */
void supine_safetensors_platform_free(void *memory);

#endif
