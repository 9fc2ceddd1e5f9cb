/* SPDX-License-Identifier: MIT */
/** @file Open files to read.
 *
 * A file that names other files may come from anybody. Such names go through
 * supine_input_open_beside, and through no other function. */
#ifndef SUPINE_INPUT_H
#define SUPINE_INPUT_H

#include <stddef.h>
#include <stdio.h>

#include <supine/status.h>

/** Open a regular file that the user named. Refuse folders, pipes and devices without waiting.
 * @param file  written; the caller closes it
 * @param size  size in bytes, written
 * @return SUPINE_ERROR_READ if the file is missing, not readable or not regular */
supine_status supine_input_open(const char *path, FILE **file, size_t *size, supine_error *error);

/** Open a file that the file `path` names: a regular file in the same folder.
 * @param name  name in the file `path`; a leading "./" is skipped
 * @param file  written; the caller closes it
 * @param size  size in bytes, written
 * @return SUPINE_ERROR_FORMAT if the name has another '/', or leads by a link to another folder, or
 *   to a folder, pipe or device, of which none is opened; SUPINE_ERROR_READ if the file is missing
 *   or not readable */
supine_status supine_input_open_beside(const char *path, const char *name, FILE **file,
                                       size_t *size, supine_error *error);

#endif
