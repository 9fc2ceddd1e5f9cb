/* SPDX-License-Identifier: MIT */
/* Write OBJ text. */
#include "base/number.h"
#include "mesh/io/save.h"

void supine_mesh_save_obj(const mesh_writer *writer) {
  const supine_mesh *mesh = writer->mesh;
  (void)fprintf(writer->out, "# SPACE=%s %s\n", writer->space, writer->unit);
  if (writer->comment[0] != '\0') {
    (void)fprintf(writer->out, "# %s\n", writer->comment);
  }
  for (size_t i = 0; i < mesh->vertex_count; ++i) {
    float position[3];
    supine_mesh_writer_position(writer, i, position);
    (void)supine_print(writer->out, "v %.9g %.9g %.9g\n", (double)position[0], (double)position[1],
                       (double)position[2]);
  }
  for (size_t t = 0; t < mesh->triangle_count; ++t) {
    uint32_t corner[3];
    supine_mesh_writer_triangle(writer, t, corner);
    (void)fprintf(writer->out, "f %lu %lu %lu\n", corner[0] + 1UL, corner[1] + 1UL,
                  corner[2] + 1UL);
  }
}
