/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Poses from a file and into one. */
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "program/stream/poses.h"
#include "sh/base/csv.h"

static const char *const columns[] = {"seconds", "gravity_x", "gravity_y", "gravity_z"};

static supine_status take(const supine_csv *csv, supine_stream_poses *poses, supine_error *error) {
  supine_stream_pose *pose = &poses->pose[poses->count];
  double number[4];
  for (size_t i = 0; i < 4; ++i) {
    const supine_status status = supine_csv_number(csv, i, columns[i], &number[i], error);
    if (status != SUPINE_OK) {
      return status;
    }
  }
  const double length = sqrt(number[1] * number[1] + number[2] * number[2] + number[3] * number[3]);
  const double before = poses->count == 0 ? 0.0 : pose[-1].seconds;
  if (!(number[0] >= before)) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "%s:%zu: %g s comes after %g s: times begin at 0 and must not fall",
                            csv->path, csv->line, number[0], before);
  }
  if (!(length > 1e-9) || !isfinite(length)) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "%s:%zu: gravity is 0,0,0: give a direction", csv->path, csv->line);
  }
  *pose =
      (supine_stream_pose){number[0], {number[1] / length, number[2] / length, number[3] / length}};
  ++poses->count;
  return SUPINE_OK;
}

supine_status supine_stream_poses_load(const char *path, supine_stream_poses *poses,
                                       supine_error *error) {
  supine_csv csv = {0};
  size_t room = 0;
  bool more = true;
  *poses = (supine_stream_poses){0};
  supine_status status = supine_csv_open(path, columns, 4, 4, &csv, error);
  while (status == SUPINE_OK) {
    status = supine_csv_next(&csv, &more, error);
    if (status != SUPINE_OK || !more) {
      break;
    }
    if (poses->count == SUPINE_STREAM_POSES_MAX) {
      status =
          supine_error_set(error, SUPINE_ERROR_FORMAT, "%s: more than %d poses: split the file",
                           path, SUPINE_STREAM_POSES_MAX);
      break;
    }
    if (poses->count == room) {
      room = room == 0 ? 1024 : 2 * room;
      supine_stream_pose *larger = realloc(poses->pose, room * sizeof *larger);
      if (larger == NULL) {
        status = supine_error_set(error, SUPINE_ERROR_MEMORY, "out of memory");
        break;
      }
      poses->pose = larger;
    }
    status = take(&csv, poses, error);
  }
  supine_csv_close(&csv);
  if (status == SUPINE_OK && poses->count == 0) {
    status = supine_error_set(error, SUPINE_ERROR_FORMAT,
                              "%s: no poses: record some with 'supine stream --record'", path);
  }
  if (status != SUPINE_OK) {
    supine_stream_poses_free(poses);
  }
  return status;
}

void supine_stream_poses_free(supine_stream_poses *poses) {
  free(poses->pose);
  *poses = (supine_stream_poses){0};
}

void supine_stream_poses_begin(FILE *file) {
  (void)fputs("seconds,gravity_x,gravity_y,gravity_z\n", file);
}

void supine_stream_poses_add(FILE *file, const supine_stream_pose *pose) {
  (void)fprintf(file, "%.17g,%.17g,%.17g,%.17g\n", pose->seconds, pose->gravity[0],
                pose->gravity[1], pose->gravity[2]);
}
