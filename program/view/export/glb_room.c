/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Append a table under the patient and an arrow that shows gravity to a glTF file. */
#include <math.h>

#include "program/view/export/glb.h"

enum { SIDES = 16, RINGS = 5 };

/* Append a solid of revolution about the vertical axis and return its node. `profile` has the
 * radius and the height of each ring, mm. The mesh has no normals, so that facets look flat. */
static json_int_t sweep(glb *g, const char *name, const double profile[RINGS][2], size_t sides,
                        const double rgb[3]) {
  float places[RINGS * SIDES][3];
  uint32_t corners[(RINGS - 1) * SIDES * 6];
  size_t at = 0;
  for (size_t ring = 0; ring < RINGS; ++ring) {
    for (size_t i = 0; i < sides; ++i) {
      const double angle = 6.28318530717958648 * ((double)i + 0.5) / (double)sides;
      float *place = places[ring * sides + i];
      place[0] = (float)(profile[ring][0] * cos(angle) / g->step);
      place[1] = (float)(profile[ring][0] * sin(angle) / g->step);
      place[2] = (float)(profile[ring][1] / g->step);
    }
  }
  for (size_t ring = 0; ring + 1 < RINGS; ++ring) {
    for (size_t i = 0; i < sides; ++i) {
      const uint32_t a = (uint32_t)(ring * sides + i);
      const uint32_t b = (uint32_t)(ring * sides + (i + 1) % sides);
      const uint32_t up = (uint32_t)sides;
      const uint32_t quad[] = {a, b, b + up, a, b + up, a + up};
      for (size_t c = 0; c < 6; ++c) {
        corners[at++] = quad[c];
      }
    }
  }
  const json_int_t material = supine_export_glb_material(g, name, rgb);
  const json_int_t indices = supine_export_glb_put(g, GLB_CORNERS, corners, NULL, at);
  return supine_export_glb_show(
      g, name,
      json_pack("{s:[{s:{s:I}, s:I, s:I}]}", "primitives", "attributes", "POSITION",
                supine_export_glb_put(g, GLB_POSITIONS, places, NULL, RINGS * sides), "indices",
                indices, "material", material));
}

json_t *supine_export_glb_room(glb *g) {
  static const double grey[3] = {0.45, 0.52, 0.62};
  static const double red[3] = {0.80, 0.25, 0.05};
  const double r = g->targets.half_extent;
  const double top = -1.15 * r;
  const double table[RINGS][2] = {
      {0, top - 0.06 * r}, {1.5 * r, top - 0.06 * r}, {1.5 * r, top}, {0, top}, {0, top}};
  const double low = top + 0.02 * r;
  const double arrow[RINGS][2] = {{0, low},
                                  {0.08 * r, low + 0.16 * r},
                                  {0.03 * r, low + 0.16 * r},
                                  {0.03 * r, low + 0.45 * r},
                                  {0, low + 0.45 * r}};
  const json_int_t under = sweep(g, "table", table, 4, grey);
  const json_int_t down = sweep(g, "gravity", arrow, SIDES, red);
  (void)json_object_set_new(json_array_get(g->nodes, (size_t)down), "translation",
                            json_pack("[f,f,f]", 1.25e-3 * r, 0.0, 0.0));
  return json_pack("[i, I, I]", 0, under, down);
}
