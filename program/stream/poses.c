/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Read and write recorded poses. */
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "base/csv.h"
#include "base/vec3.h"
#include "program/stream/server.h"

static const char *const columns[] = {"seconds", "gravity_x", "gravity_y", "gravity_z"};

/* Read a pose from a row. `before` is the time of the previous pose, s; 0 for the first pose. */
static supine_status read_pose(const supine_csv *csv, double before, supine_stream_pose *pose,
                               supine_error *error) {
  double number[4];
  for (size_t i = 0; i < 4; ++i) {
    const supine_status status = supine_csv_number(csv, i, columns[i], &number[i], error);
    if (status != SUPINE_OK) {
      return status;
    }
  }
  const double length = supine_length(number + 1);
  if (!(number[0] >= before)) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "%s:%zu: the time %g s is before %g s: times begin at 0 s or later "
                            "and must not decrease",
                            csv->path, csv->line, number[0], before);
  }
  if (!(length > 1e-9) || !isfinite(length)) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "%s:%zu: gravity is zero or not finite: give a direction, such as "
                            "0,1,0 for supine",
                            csv->path, csv->line);
  }
  *pose =
      (supine_stream_pose){number[0], {number[1] / length, number[2] / length, number[3] / length}};
  return SUPINE_OK;
}

supine_status supine_stream_poses_load(const char *path, supine_stream_poses *poses,
                                       supine_error *error) {
  supine_csv csv = {0};
  bool more = true;
  *poses = (supine_stream_poses){0};
  supine_status status = supine_csv_open(path, columns, 4, 4, &csv, error);
  while (status == SUPINE_OK && more) {
    supine_stream_pose *grown = reallocarray(poses->pose, poses->count + 1, sizeof *grown);
    if (grown == NULL) {
      status = supine_error_set(error, SUPINE_ERROR_MEMORY, "out of memory");
      break;
    }
    poses->pose = grown;
    status = supine_csv_next(&csv, &more, error);
    if (status == SUPINE_OK && more) {
      const double before = poses->count == 0 ? 0.0 : grown[poses->count - 1].seconds;
      status = read_pose(&csv, before, &grown[poses->count++], error);
    }
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
