/* SPDX-License-Identifier: MIT */
/* Write binary STL. */
#include <math.h>
#include <string.h>

#include "base/vec3.h"

#include "mesh/io/save.h"

enum { HEADER = 80 };

/* Find the unit normal of a triangle; 0 if its corners are collinear. */
static void facet_normal(float (*corners)[3], float normal[3]) {
  double p[3][3];
  double n[3];
  for (int k = 0; k < 9; ++k) {
    p[k / 3][k % 3] = (double)corners[k / 3][k % 3];
  }
  supine_normal(p[0], p[1], p[2], n);
  const double length = supine_length(n);
  const double scale = length > 0.0 && isfinite(length) ? 1.0 / length : 0.0;
  for (int axis = 0; axis < 3; ++axis) {
    normal[axis] = scale > 0.0 ? (float)(scale * n[axis]) : 0.0F;
  }
}

void supine_io_save_stl(const mesh_writer *writer) {
  const supine_mesh *mesh = writer->mesh;
  /* The header must not begin with "solid", which marks STL text. */
  char text[HEADER + 1 + sizeof writer->comment];
  (void)snprintf(text, sizeof text, "SPACE=%s %s %s", writer->space, writer->unit, writer->comment);
  const uint32_t count = (uint32_t)mesh->triangle_count;
  memset(text + strlen(text), 0, sizeof text - strlen(text));
  (void)fwrite(text, 1, HEADER, writer->out);
  (void)fwrite(&count, sizeof count, 1, writer->out);
  for (size_t t = 0; t < mesh->triangle_count; ++t) {
    static const uint16_t attributes = 0;
    float facet[4][3]; /* normal, then the corners */
    uint32_t corner[3];
    supine_io_writer_triangle(writer, t, corner);
    for (size_t k = 0; k < 3; ++k) {
      supine_io_writer_position(writer, corner[k], facet[1 + k]);
    }
    facet_normal(facet + 1, facet[0]);
    (void)fwrite(facet, sizeof facet, 1, writer->out);
    (void)fwrite(&attributes, sizeof attributes, 1, writer->out);
  }
}
