/* SPDX-License-Identifier: MIT */
/** @file Write output files whole or not at all.
 *
 * A file is written under a temporary name in its folder. It gets its final name when it is
 * complete and on the disk. */
#ifndef SUPINE_OUTPUT_H
#define SUPINE_OUTPUT_H

#include <stdbool.h>
#include <stdio.h>

#include <supine/status.h>

/** A file being written. Write to `file` with stdio. It is seekable unless it is a pipe or device.
 * supine_output_commit reports errors. */
typedef struct supine_output {
  FILE *file;
  char *path;      /**< path as given by the user */
  char *target;    /**< path with symbolic links followed */
  char *temporary; /**< temporary name; NULL or "" if there is none */
  bool standard;   /**< the file is standard output */
} supine_output;

/** Open an output file. A new file gets its mode from the umask; a replaced file keeps its mode. If
 * the path is a symbolic link, replace its target. Write directly to a device, pipe or standard
 * output. */
supine_status supine_output_open(const char *path, supine_output *output, supine_error *error);

/** Flush, wait until the file is on the disk, and give the file its name. On failure, remove the
 * new file and leave an existing file unchanged. */
supine_status supine_output_commit(supine_output *output, supine_error *error);

/** Discard the file unless it was committed. This is allowed after a failed open, and for a zeroed
 * struct. */
void supine_output_abandon(supine_output *output);

/** Return whether the path means standard output: "-", alone or with an ending ("-.ply"). */
bool supine_output_is_standard(const char *path);

/** Reserve standard output for supine_output_open. From then on, all other output goes to standard
 * error. Return false if standard output is closed, or open for reading only. */
bool supine_output_take_standard(void);

/** Check that a file can be written. Leave no new file. */
supine_status supine_output_try(const char *path, supine_error *error);

/** Return the path of `name` in the folder of the file `path`, or `name` if it is absolute; the
 * caller frees it. Return NULL if out of memory. */
char *supine_path_beside(const char *path, const char *name);

/** Remove the temporary files of all outputs of the process. Safe in signal handlers. */
void supine_output_abandon_all(void);

#endif
