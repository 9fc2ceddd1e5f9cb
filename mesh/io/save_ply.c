/* SPDX-License-Identifier: MIT */
/* Write binary little-endian PLY. */
#include "mesh/io/save.h"

void supine_io_save_ply(const mesh_writer *writer) {
  const supine_mesh *mesh = writer->mesh;
  (void)fprintf(writer->out, "ply\nformat binary_little_endian 1.0\ncomment SPACE=%s %s\n",
                writer->space, writer->unit);
  if (writer->comment[0] != '\0') {
    (void)fprintf(writer->out, "comment %s\n", writer->comment);
  }
  (void)fprintf(writer->out,
                "element vertex %zu\nproperty float x\nproperty float y\nproperty float z\n",
                mesh->vertex_count);
  if (writer->options.from != NULL) {
    (void)fputs("property float displacement_x\nproperty float displacement_y\n"
                "property float displacement_z\nproperty float displacement_magnitude\n",
                writer->out);
  }
  for (size_t k = 0; k < SUPINE_MESH_SCALARS; ++k) {
    if (writer->options.scalars[k].values != NULL) {
      (void)fprintf(writer->out, "property float %s\n", writer->options.scalars[k].name);
    }
  }
  (void)fprintf(writer->out,
                "element face %zu\nproperty list uchar int vertex_indices\nend_header\n",
                mesh->triangle_count);
  for (size_t i = 0; i < mesh->vertex_count; ++i) {
    float row[7 + SUPINE_MESH_SCALARS];
    size_t count = 3;
    supine_io_writer_position(writer, i, row);
    if (writer->options.from != NULL) {
      supine_io_writer_displacement(writer, i, row + 3);
      count = 7;
    }
    for (size_t k = 0; k < SUPINE_MESH_SCALARS; ++k) {
      if (writer->options.scalars[k].values != NULL) {
        row[count++] = writer->options.scalars[k].values[i];
      }
    }
    (void)fwrite(row, sizeof *row, count, writer->out);
  }
  for (size_t t = 0; t < mesh->triangle_count; ++t) {
    uint32_t corner[3];
    supine_io_writer_triangle(writer, t, corner);
    (void)fputc(3, writer->out);
    (void)fwrite(corner, sizeof corner, 1, writer->out);
  }
}
