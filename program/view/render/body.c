/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Make the surface of a torso around the lungs. It shows how the patient lies; it is only
 * drawn, and no result depends on it. */
#include <math.h>
#include <string.h>

#include "base/vec3.h"
#include "program/view/render/canvas.h"

static const double pi = 3.14159265358979323846;

static const double torso[SUPINE_RENDER_SECTIONS][3] = {
    {-4.4, 1.2, 1.16}, {-3, 1.2, 1.14},    {-2, 1.1, 1.08},     {-1, 1.16, 1.18},   {0, 1.3, 1.22},
    {0.6, 1.45, 1.14}, {1, 1.42, 0.94},    {1.25, 0.95, 0.72},  {1.45, 0.44, 0.54}, {1.7, 0.4, 0.52},
    {1.92, 0.46, 0.7}, {2.3, 0.56, 0.84},  {2.65, 0.52, 0.78},  {2.9, 0.34, 0.5},   {3, 0.001, 0.001}};

enum {
  SECTIONS = SUPINE_RENDER_SECTIONS,
  BETWEEN = 6, /* sections of the surface from one section of the table to the next */
  RINGS = (SECTIONS - 1) * BETWEEN + 1,
  SIDES = 48,
};

const double *supine_render_torso(size_t i) {
  return i < SECTIONS ? torso[i] : NULL;
}

/* Interpolate the table at section `ring` of the surface by a Catmull-Rom spline. */
static void section(size_t ring, double at[3]) {
  const size_t i = ring / BETWEEN < SECTIONS - 1 ? ring / BETWEEN : SECTIONS - 2;
  const double t = (double)(ring - i * BETWEEN) / BETWEEN;
  const double *a = torso[i > 0 ? i - 1 : 0];
  const double *b = torso[i];
  const double *c = torso[i + 1];
  const double *d = torso[i + 2 < SECTIONS ? i + 2 : SECTIONS - 1];
  for (size_t k = 0; k < 3; ++k) {
    const double cubic = 3 * (b[k] - c[k]) + d[k] - a[k];
    const double square = 2 * a[k] - 5 * b[k] + 4 * c[k] - d[k];
    at[k] = b[k] + 0.5 * t * (c[k] - a[k] + t * (square + t * cubic));
  }
}

supine_status supine_render_body(const supine_basis_info *info, supine_arena *keep, body *made,
                                 supine_error *error) {
  double low[3] = {INFINITY, INFINITY, INFINITY};
  double high[3] = {-INFINITY, -INFINITY, -INFINITY};
  double centre[3];
  double half[3];
  made->vertex_count = (size_t)RINGS * SIDES;
  made->triangle_count = (size_t)2 * (RINGS - 1) * SIDES;
  made->xyz = supine_arena_take(keep, 3 * made->vertex_count, sizeof *made->xyz);
  made->normals = supine_arena_take(keep, 3 * made->vertex_count, sizeof *made->normals);
  made->triangles = supine_arena_take(keep, 3 * made->triangle_count, sizeof *made->triangles);
  SUPINE_TRY(supine_arena_check(keep, error, "a torso of %zu vertices", made->vertex_count));
  supine_render_box(info->vertices, info->vertex_count, low, high);
  for (size_t k = 0; k < 3; ++k) {
    centre[k] = (low[k] + high[k]) / 2;
    half[k] = fmax(1.0, (high[k] - low[k]) / 2);
  }
  uint32_t *next = made->triangles;
  for (size_t i = 0; i < made->vertex_count; ++i) {
    const size_t ring = i / SIDES;
    const double angle = 2 * pi * (double)(i % SIDES) / SIDES;
    double at[3];
    section(ring, at);
    const double out[3] = {cos(angle) * at[1] * half[0], sin(angle) * at[2] * half[1],
                           at[0] * half[2]};
    const double normal[3] = {cos(angle) / (at[1] * half[0]), sin(angle) / (at[2] * half[1]), 0};
    for (size_t k = 0; k < 3; ++k) {
      made->xyz[3 * i + k] = (float)(centre[k] + out[k]);
      made->normals[3 * i + k] = (float)(normal[k] / supine_length(normal));
    }
    if (ring + 1 < RINGS) {
      const uint32_t a = (uint32_t)i;
      const uint32_t b = (uint32_t)(ring * SIDES + (i + 1) % SIDES);
      const uint32_t corners[6] = {a, b, b + SIDES, a, b + SIDES, a + SIDES};
      memcpy(next, corners, sizeof corners);
      next += 6;
    }
  }
  return SUPINE_OK;
}
