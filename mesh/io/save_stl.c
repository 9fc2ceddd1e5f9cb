/* SPDX-License-Identifier: MIT */
/* Write binary STL. */
#include <math.h>
#include <string.h>

#include "base/vec3.h"

#include "mesh/io/save.h"

enum { HEADER = 80, FACET = 50 };

/* Find the unit normal of a triangle; 0 if its corners are collinear. */
static void facet_normal(float corners[3][3], float normal[3]) {
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

supine_status supine_mesh_save_stl(const mesh_writer *writer) {
  const supine_mesh *mesh = writer->mesh;
  /* The header must not begin with "solid", which marks STL text. */
  char text[HEADER + 1 + sizeof writer->comment];
  (void)snprintf(text, sizeof text, "SPACE=%s %s %s", writer->space, writer->unit, writer->comment);
  unsigned char header[HEADER + 4] = {0};
  memcpy(header, text, strnlen(text, HEADER));
  unsigned char *at = header + HEADER;
  const uint32_t count = (uint32_t)mesh->triangle_count;
  supine_mesh_put_u32(&at, &count, 1);
  (void)fwrite(header, 1, sizeof header, writer->out);
  for (size_t t = 0; t < mesh->triangle_count; ++t) {
    float corners[3][3];
    float normal[3];
    uint32_t corner[3];
    supine_mesh_writer_triangle(writer, t, corner);
    for (size_t k = 0; k < 3; ++k) {
      supine_mesh_writer_position(writer, corner[k], corners[k]);
    }
    facet_normal(corners, normal);
    unsigned char bytes[FACET] = {0};
    at = bytes;
    supine_mesh_put_f32(&at, normal, 3);
    for (size_t k = 0; k < 3; ++k) {
      supine_mesh_put_f32(&at, corners[k], 3);
    }
    (void)fwrite(bytes, 1, sizeof bytes, writer->out);
  }
  return SUPINE_OK;
}
