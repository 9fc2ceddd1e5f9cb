/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Recorded poses: the direction of gravity in the body over time, as CSV.
 *
 *     seconds,gravity_x,gravity_y,gravity_z      times from 0 on, never falling */
#ifndef SUPINE_STREAM_POSES_H
#define SUPINE_STREAM_POSES_H

#include <stdio.h>

#include <supine/status.h>

typedef struct supine_stream_pose {
  double seconds;
  double gravity[3]; /**< unit */
} supine_stream_pose;

typedef struct supine_stream_poses {
  size_t count;
  supine_stream_pose *pose;
} supine_stream_poses;

/** Read a file; release with supine_stream_poses_free.
 * @retval SUPINE_ERROR_READ, SUPINE_ERROR_FORMAT (the message names the line), SUPINE_ERROR_MEMORY
 */
supine_status supine_stream_poses_load(const char *path, supine_stream_poses *poses,
                                       supine_error *error);
void supine_stream_poses_free(supine_stream_poses *poses);

/** Write the header of such a file, and a line with enough digits to read back the same numbers. */
void supine_stream_poses_begin(FILE *file);
void supine_stream_poses_add(FILE *file, const supine_stream_pose *pose);

#endif
