/* SPDX-License-Identifier: MIT */
/* Convert numbers to the axes and units of a file, for all formats. */
#include <float.h>
#include <math.h>

#include "base/arena.h"

#include "mesh/io/save.h"

static bool fits(double x) {
  return fabs(x) <= (double)FLT_MAX;
}

supine_status supine_io_writer_check(const char *path, const supine_mesh *mesh,
                                     supine_error *error) {
  SUPINE_REFUSE_IF(mesh->vertex_count > INT32_MAX || mesh->triangle_count > INT32_MAX / 3, error,
                   SUPINE_ERROR_ARGUMENT,
                   "%s: too large to write: %zu vertices, %zu triangles: write a coarser mesh",
                   path, mesh->vertex_count, mesh->triangle_count);
  for (size_t i = 0; i < mesh->vertex_count; ++i) {
    const double *vertex = mesh->vertices + 3 * i;
    SUPINE_REFUSE_IF(
        !fits(vertex[0]) || !fits(vertex[1]) || !fits(vertex[2]), error, SUPINE_ERROR_MESH,
        "%s: vertex %zu has a coordinate that is not finite: choose a state nearer to the scan",
        path, i);
  }
  return SUPINE_OK;
}

static void copy_comment(const char *comment, char *line, size_t size) {
  size_t length = 0;
  if (comment != NULL) {
    for (; comment[length] != '\0' && length < size - 1; ++length) {
      const unsigned char c = (unsigned char)comment[length];
      line[length] = comment[length];
      if (c < ' ' || c == 0x7F) {
        line[length] = ' ';
      }
    }
  }
  line[length] = '\0';
}

void supine_io_writer_begin(const supine_mesh *mesh, const supine_mesh_save_options *options,
                            mesh_writer *writer) {
  const supine_mesh_save_options chosen =
      options == NULL ? (supine_mesh_save_options){0} : *options;
  const double unit = chosen.millimetres_per_unit == 0.0 ? 1.0 : chosen.millimetres_per_unit;
  double matrix[3][3];
  *writer = (mesh_writer){
      .mesh = mesh, .options = chosen, .mirrored = supine_mesh_axes_mirrored(chosen.axes)};
  supine_mesh_axes_letters(chosen.axes, writer->space);
  supine_mesh_axes_matrix(chosen.axes, matrix);
  for (unsigned i = 0; i < 9; ++i) {
    if (matrix[i / 3][i % 3] != 0.0) {
      writer->source[i % 3] = (unsigned char)(i / 3);
      writer->factor[i % 3] = matrix[i / 3][i % 3] / unit;
    }
  }
  copy_comment(chosen.comment, writer->comment, sizeof writer->comment);
  supine_mesh_unit_name(unit, writer->unit);
}

void supine_io_writer_normal(const mesh_writer *writer, size_t i, float normal[3]) {
  for (size_t axis = 0; axis < 3; ++axis) { /* + 0.0 turns -0.0 into 0.0 */
    const float value = writer->options.normals[3 * i + writer->source[axis]];
    normal[axis] = (writer->factor[axis] < 0.0 ? -value : value) + 0.0F;
  }
}

void supine_io_writer_position(const mesh_writer *writer, size_t i, float position[3]) {
  for (size_t axis = 0; axis < 3; ++axis) {
    const double vertex = writer->mesh->vertices[3 * i + writer->source[axis]];
    position[axis] = (float)(writer->factor[axis] * vertex + 0.0);
  }
}

void supine_io_writer_displacement(const mesh_writer *writer, size_t i, float displacement[4]) {
  double square = 0.0;
  for (size_t axis = 0; axis < 3; ++axis) {
    const size_t from = 3 * i + writer->source[axis];
    const double d = writer->mesh->vertices[from] - writer->options.from[from];
    const double scaled = writer->factor[axis] * d;
    displacement[axis] = (float)(scaled + 0.0);
    square += scaled * scaled;
  }
  displacement[3] = (float)sqrt(square);
}

void supine_io_writer_triangle(const mesh_writer *writer, size_t t, uint32_t corner[3]) {
  const uint32_t *from = writer->mesh->triangles + 3 * t;
  corner[0] = from[0];
  corner[1] = from[writer->mirrored ? 2 : 1];
  corner[2] = from[writer->mirrored ? 1 : 2];
}
