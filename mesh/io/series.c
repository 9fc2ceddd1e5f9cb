/* SPDX-License-Identifier: MIT */
/* Write a series of surfaces into one VTP file: the arrays in order, then their offsets into the
 * space reserved at the head. */
#include <stdlib.h>

#include "sh/base/output.h"

#include "mesh/io/vtp.h"

struct supine_mesh_series {
  supine_output output;
  vtp file;
};

static supine_status no_memory(const char *path, supine_error *error) {
  return supine_error_set(error, SUPINE_ERROR_MEMORY, "%s: out of memory", path);
}

supine_status supine_mesh_series_open(const char *path, const supine_mesh *mesh,
                                      const supine_mesh_save_options *options, size_t frames,
                                      const double *times, supine_mesh_series **series,
                                      supine_error *error) {
  *series = NULL;
  supine_status status = supine_mesh_writer_check(path, mesh, error);
  if (status != SUPINE_OK) {
    return status;
  }
  supine_mesh_series *made = calloc(1, sizeof *made);
  if (made == NULL) {
    return no_memory(path, error);
  }
  status = supine_output_open(path, &made->output, error);
  if (status == SUPINE_OK && fseeko(made->output.file, 0, SEEK_SET) != 0) {
    status =
        supine_error_set(error, SUPINE_ERROR_WRITE,
                         "%s: a series cannot be written into a pipe or device: give a file", path);
  }
  if (status == SUPINE_OK) {
    made->file.frames = frames;
    made->file.times = times;
    supine_mesh_writer_begin(mesh, options, &made->file.writer);
    status = supine_mesh_vtp_begin(&made->file);
    if (status != SUPINE_OK) {
      (void)no_memory(path, error);
    }
  }
  if (status != SUPINE_OK) {
    supine_mesh_series_close(made);
    return status;
  }
  supine_mesh_vtp_head(&made->file, made->output.file);
  *series = made;
  return SUPINE_OK;
}

supine_status supine_mesh_series_add(supine_mesh_series *series, supine_error *error) {
  const char *path = series->output.path;
  supine_status status = supine_mesh_writer_check(path, series->file.writer.mesh, error);
  if (status == SUPINE_OK) {
    status = supine_mesh_vtp_frame(&series->file, series->output.file);
    if (status != SUPINE_OK) {
      (void)no_memory(path, error);
    }
  }
  return status;
}

supine_status supine_mesh_series_commit(supine_mesh_series *series, supine_error *error) {
  supine_mesh_vtp_foot(series->output.file);
  (void)fseeko(series->output.file, 0, SEEK_SET); /* a failure shows in the stream */
  supine_mesh_vtp_head(&series->file, series->output.file);
  return supine_output_commit(&series->output, error);
}

void supine_mesh_series_close(supine_mesh_series *series) {
  if (series != NULL) {
    supine_output_abandon(&series->output);
    supine_mesh_vtp_end(&series->file);
    free(series);
  }
}
