/* SPDX-License-Identifier: MIT */
/** @file
 * Output folders that appear whole or not at all.
 *
 * A folder cannot grow without a name as a file can (sh/base/output.h), so it grows under a
 * temporary one, and a process of its own, the keeper, removes it when this one has ended before
 * the folder was complete, in whatever way: SIGKILL too. */
#ifndef SUPINE_FOLDER_H
#define SUPINE_FOLDER_H

#include <stdbool.h>
#include <sys/types.h>

#include <supine/status.h>

/** A folder on its way. Write files into `temporary`. */
typedef struct supine_folder {
  char *path;      /**< its name when it is complete */
  char *index;     /**< a file beside it that belongs to it, or NULL */
  char *temporary; /**< its name until then */
  bool named;      /**< renamed, but not to be kept yet */
  int line;        /**< to the keeper */
  pid_t keeper;
} supine_folder;

/** Begins a folder. Where `path` is a folder already it must be empty.
 * @param index  a file that will be written after supine_folder_rename and removed together with
 *               the folder if the process ends before supine_folder_keep; or NULL
 * @retval SUPINE_ERROR_WRITE  there is something of that name, or no folder can be made there
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_folder_open(const char *path, const char *index, supine_folder *folder,
                                 supine_error *error);

/** Gives the complete folder its name; it is still removed unless supine_folder_keep follows.
 * @retval SUPINE_ERROR_WRITE */
supine_status supine_folder_rename(supine_folder *folder, supine_error *error);

/** From here on the folder stays. */
void supine_folder_keep(supine_folder *folder);

/** Frees the struct, and removes the folder if it was not kept; legal after open failed and on a
 * zeroed struct. */
void supine_folder_close(supine_folder *folder);

#endif
