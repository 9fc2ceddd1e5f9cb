/* SPDX-License-Identifier: MIT */
/** @file
 * Output files that appear whole or not at all: written under a temporary name in the same folder,
 * then renamed over the old file. */
#ifndef SUPINE_OUTPUT_H
#define SUPINE_OUTPUT_H

#include <stdio.h>

#include <supine/status.h>

#ifdef __cplusplus
extern "C" {
#endif

/** A file on its way. Write to `file` with stdio; errors may be left for commit to find. */
typedef struct supine_output {
  FILE *file;
  char *path;
  char *temporary;
} supine_output;

/** Begins a file. A path that names a device or pipe is written directly.
 * @retval SUPINE_ERROR_WRITE  the folder is missing or not writable, or the path is a folder
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_output_open(const char *path, supine_output *output, supine_error *error);

/** Flushes, closes and renames. On failure nothing is left behind and an old file is as it was.
 * @retval SUPINE_ERROR_WRITE  some write failed: full disk, file too large */
supine_status supine_output_commit(supine_output *output, supine_error *error);

/** Drops the file; legal after open failed, after commit, and on a zeroed struct. */
void supine_output_abandon(supine_output *output);

#ifdef __cplusplus
}
#endif
#endif
