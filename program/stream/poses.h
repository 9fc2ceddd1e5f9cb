/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Poses kept: gravity in the body over time, as CSV.
 *
 *     seconds,gravity_x,gravity_y,gravity_z      from 0 on, never falling; any length but 0 */
#ifndef SUPINE_STREAM_POSES_H
#define SUPINE_STREAM_POSES_H

#include <stdio.h>

#include <supine/status.h>

enum { SUPINE_STREAM_POSES_MAX = 5000000 }; /**< 20 hours at 66.66 a second */

typedef struct supine_stream_pose {
  double seconds;
  double gravity[3]; /**< unit */
} supine_stream_pose;

typedef struct supine_stream_poses {
  size_t count;
  supine_stream_pose *pose;
} supine_stream_poses;

/** Reads them; release with supine_stream_poses_free.
 * @retval SUPINE_ERROR_READ, SUPINE_ERROR_FORMAT (the message names the line), SUPINE_ERROR_MEMORY
 */
supine_status supine_stream_poses_load(const char *path, supine_stream_poses *poses,
                                       supine_error *error);
void supine_stream_poses_free(supine_stream_poses *poses);

/** The header of such a file, and a line; digits enough to read back the very same numbers. */
void supine_stream_poses_begin(FILE *file);
void supine_stream_poses_add(FILE *file, const supine_stream_pose *pose);

#endif
