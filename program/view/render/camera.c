/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Look at the lungs: views, extents, and the projection of positions to the picture. */
#include <math.h>
#include <string.h>

#include "base/vec3.h"
#include "program/view/render/canvas.h"

/* Names of the views, and rotations from the body's axes (LPS) to the viewer's axes. */
static const struct {
  const char *name;
  double axes[3][3]; /* rows: right, up, towards the viewer */
} views[SUPINE_VIEW_COUNT] = {
    {"anterior", {{1, 0, 0}, {0, 0, 1}, {0, -1, 0}}},
    {"posterior", {{-1, 0, 0}, {0, 0, 1}, {0, 1, 0}}},
    {"left", {{0, 1, 0}, {0, 0, 1}, {1, 0, 0}}},
    {"right", {{0, -1, 0}, {0, 0, 1}, {-1, 0, 0}}},
    {"head", {{-1, 0, 0}, {0, -1, 0}, {0, 0, 1}}},
    {"feet", {{1, 0, 0}, {0, -1, 0}, {0, 0, -1}}},
    {"lying", {{1, 0, 0}, {0, 0, 1}, {0, -1, 0}}}, /* of a patient who stands */
};

const char *supine_render_view_name(supine_view view) {
  return view < SUPINE_VIEW_COUNT ? views[view].name : NULL;
}

void supine_render_view_axes(supine_view view, const double gravity[3], double axes[3][3]) {
  memcpy(axes, views[view].axes, sizeof views[view].axes);
  if (view != SUPINE_VIEW_LYING || fabs(gravity[2]) > SUPINE_VIEW_LYING_TILT) {
    return;
  }
  const double flat = sqrt(1 - gravity[2] * gravity[2]);
  for (size_t k = 0; k < 3; ++k) {
    axes[1][k] = -gravity[k];
    axes[0][k] = ((k == 2 ? -1 : 0) + gravity[2] * gravity[k]) / flat; /* towards the feet */
  }
  supine_cross(axes[0], axes[1], axes[2]);
}

/* Distances, in half diagonals of the lungs' bounding box. */
static const double viewer_distance = 5.0; /* from the viewer to the centre of the lungs */
static const double drawn_depth = 3.0;     /* largest distance from the centre towards the viewer at
                                              which points are drawn, in radii */
static const double margin = 1.03; /* size of the picture divided by the size of the lungs in it */
void supine_render_box(const float *xyz, size_t count, double low[3], double high[3]) {
  for (size_t i = 0; i < 3 * count; ++i) {
    low[i % 3] = fmin(low[i % 3], (double)xyz[i]);
    high[i % 3] = fmax(high[i % 3], (double)xyz[i]);
  }
}

camera supine_render_camera(const supine_basis_info *info, const supine_scene *scene) {
  camera c = {.radius = 1e-3};
  double low[3] = {INFINITY, INFINITY, INFINITY};
  double high[3] = {-INFINITY, -INFINITY, -INFINITY};
  supine_render_view_axes(scene->view, scene->gravity, c.axes);
  supine_render_box(info->vertices, info->vertex_count, low, high);
  for (int axis = 0; axis < 3; ++axis) {
    c.centre[axis] = (low[axis] + high[axis]) / 2;
    c.radius = hypot(c.radius, (high[axis] - low[axis]) / 2);
  }
  c.away = viewer_distance * c.radius;
  return c;
}

/* Rotate a vector `v` from the body's axes to the viewer's axes. */
static void turn(const camera *c, const double v[3], double seen[3]) {
  for (size_t row = 0; row < 3; ++row) {
    seen[row] = c->axes[row][0] * v[0] + c->axes[row][1] * v[1] + c->axes[row][2] * v[2];
  }
}

/* Transform a position, mm, to the viewer's axes, with the lungs' centre as the origin. */
static void place(const camera *c, const float xyz[3], double seen[3]) {
  const double from[3] = {(double)xyz[0] - c->centre[0], (double)xyz[1] - c->centre[1],
                          (double)xyz[2] - c->centre[2]};
  turn(c, from, seen);
}

void supine_render_extent(const supine_basis *basis, const supine_scene *scene, double extent[4]) {
  enum { CHUNK = 512 };
  const supine_basis_info *info = supine_basis_get_info(basis);
  const camera c = supine_render_camera(info, scene);
  const double closest = c.away - 0.98 * drawn_depth * c.radius;
  float xyz[3 * CHUNK];
  for (size_t i = 0; i < info->vertex_count; ++i) {
    double p[3];
    if (i % CHUNK == 0) {
      const size_t end = i + CHUNK < info->vertex_count ? i + CHUNK : info->vertex_count;
      (void)supine_deform_range(basis, scene->pose, i, end, xyz);
    }
    place(&c, xyz + 3 * (i % CHUNK), p);
    for (int side = 0; side < 2; ++side) {
      const double at = p[side] * c.away / fmax(closest, c.away - p[2]);
      extent[2 * side] = fmin(extent[2 * side], at);
      extent[2 * side + 1] = fmax(extent[2 * side + 1], at);
    }
  }
}

void supine_render_camera_aim(camera *c, const supine_basis *basis, const supine_scene *scene,
                              double width, double height) {
  double extent[4] = SUPINE_EXTENT_NONE;
  if (scene->extent != NULL) {
    memcpy(extent, scene->extent, sizeof extent);
  } else {
    supine_render_extent(basis, scene, extent);
  }
  const double aspect = width / height;
  const double wide = fmax(1e-3, margin * (extent[1] - extent[0]) / 2);
  const double high = fmax(1e-3, margin * (extent[3] - extent[2]) / 2);
  const double tall = fmax(high, wide / aspect);
  c->size[0] = width;
  c->size[1] = height;
  c->frame[0] = (extent[0] + extent[1]) / 2;
  c->frame[1] = (extent[2] + extent[3]) / 2;
  c->frame[2] = 1 / (tall * aspect);
  c->frame[3] = 1 / tall;
}

/* Project a point `p` in the viewer's axes, mm, to a position `at`, measured from the left and
 * upper edges of the picture. */
static void project(const camera *c, const double p[3], double at[2]) {
  for (int side = 0; side < 2; ++side) {
    const double off = (p[side] * c->away / (c->away - p[2]) - c->frame[side]) * c->frame[2 + side];
    at[side] = 0.5 * (1 + (side == 0 ? off : -off)) * c->size[side];
  }
}

void supine_render_project(const supine_basis *basis, const supine_scene *scene,
                           const supine_marks *marks, bool from, double (*pixel)[3]) {
  camera c = supine_render_camera(supine_basis_get_info(basis), scene);
  supine_render_camera_aim(&c, basis, scene, (double)scene->width, (double)scene->height);
  for (size_t i = 0; i < marks->count; ++i) {
    double p[3];
    place(&c, from ? marks->mark[i].from : marks->mark[i].xyz, p);
    project(&c, p, pixel[i]);
    pixel[i][2] = 0.5 * c.size[1] * c.frame[3] * c.away / (c.away - p[2]);
  }
}

corner supine_render_camera_project(const camera *c, const float xyz[3], const float normal[3]) {
  const double n[3] = {(double)normal[0], (double)normal[1], (double)normal[2]};
  const double nearest = c->away - drawn_depth * c->radius;
  double p[3];
  double seen[3];
  double at[2];
  place(c, xyz, p);
  turn(c, n, seen);
  project(c, p, at);
  const double depth = c->away - p[2];
  return (corner){.x = (float)at[0],
                  .y = (float)at[1],
                  .nearness = depth > nearest ? (float)(1.0 / depth) : 0.0F,
                  .normal = {(float)seen[0], (float)seen[1], (float)seen[2]},
                  .eye = {(float)-p[0], (float)-p[1], (float)depth}};
}

float supine_render_camera_scale(const camera *c, const corner *at) {
  return (float)(0.5 * c->size[1] * c->frame[3] * c->away) * at->nearness;
}
