/* SPDX-License-Identifier: MIT */
/** @file Output folders that appear whole or not at all.
 *
 * A folder, unlike a file (sh/base/output.h), needs a name while it is written. It has a
 * temporary one, and a separate process, the keeper, removes it if this process ends before the
 * folder is complete, even by SIGKILL. */
#ifndef SUPINE_FOLDER_H
#define SUPINE_FOLDER_H

#include <stdbool.h>
#include <sys/types.h>

#include <supine/status.h>

/** A folder being written. Write files into `temporary`. */
typedef struct supine_folder {
  char *path;      /**< its final name */
  char *index;     /**< a file beside it that belongs to it, or NULL */
  char *temporary; /**< its present name */
  bool named;      /**< renamed, but not yet kept */
  int line;        /**< pipe to the keeper */
  pid_t keeper;
} supine_folder;

/** Begin a folder. If `path` exists it must be an empty folder.
 * @param index  a file that will be written after supine_folder_rename and removed together with
 *               the folder if the process ends before supine_folder_keep; or NULL
 * @retval SUPINE_ERROR_WRITE  the name is taken, or the folder cannot be created
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_folder_open(const char *path, const char *index, supine_folder *folder,
                                 supine_error *error);

/** Give the complete folder its name; without supine_folder_keep it is still removed. */
supine_status supine_folder_rename(supine_folder *folder, supine_error *error);

/** Keep the folder from here on. */
void supine_folder_keep(supine_folder *folder);

/** Free the struct, and remove the folder if it was not kept; legal after a failed open and on a
 * zeroed struct. */
void supine_folder_close(supine_folder *folder);

#endif
