/* SPDX-License-Identifier: MIT */
/** @file
 * Output files that appear whole or not at all.
 *
 * A file grows without a name (O_TMPFILE) in the folder it is for, so that nothing is left of it
 * whatever ends the program; where the file system cannot do that, under a temporary name. It is
 * given its name when it is complete and on the disk. */
#ifndef SUPINE_OUTPUT_H
#define SUPINE_OUTPUT_H

#include <stdbool.h>
#include <stdio.h>

#include <supine/status.h>

/** A file on its way. Write to `file` with stdio, which can seek but in a pipe or device; errors
 * may be left for commit to find. */
typedef struct supine_output {
  FILE *file;
  char *path;      /**< as the user wrote it */
  char *target;    /**< what it leads to, symbolic links followed */
  char *temporary; /**< its name until then; "" where it has none */
  bool standard;   /**< standard output */
  struct supine_output_stream *stream;
} supine_output;

/** Begins a file. A new one gets the mode that the process's mask allows, an old one keeps its own;
 * a symbolic link stays, and what it leads to is replaced. A path that names a device or pipe is
 * written directly, and so is standard output.
 * @retval SUPINE_ERROR_WRITE  the folder is missing or not writable, the path is a folder, or a
 *                             file that nobody may write
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_output_open(const char *path, supine_output *output, supine_error *error);

/** Flushes, waits for the disk, and gives the file its name. On failure nothing is left behind and
 * an old file is as it was.
 * @retval SUPINE_ERROR_WRITE  some write failed, and why: full disk, file too large */
supine_status supine_output_commit(supine_output *output, supine_error *error);

/** Drops the file; legal after open failed, after commit, and on a zeroed struct. */
void supine_output_abandon(supine_output *output);

/** Is it standard output: "-", or "-" and an ending that says in which format, as "-.ply"? */
bool supine_output_is_standard(const char *path);

/** Keeps standard output for supine_output_open alone: what is printed goes to standard error from
 * here on. False where it is closed. */
bool supine_output_take_standard(void);

/** Could a file of this name be written? Nothing is left of trying.
 * @retval SUPINE_ERROR_WRITE, SUPINE_ERROR_MEMORY  as supine_output_open */
supine_status supine_output_try(const char *path, supine_error *error);

/** `name` in the folder of the file `path`, to be freed; a name that begins with / stands for
 * itself. NULL without memory. */
char *supine_path_beside(const char *path, const char *name);

/** Removes the temporary files of all outputs of the process; for handlers of signals that are
 * about to end it. */
void supine_output_abandon_all(void);

#endif
