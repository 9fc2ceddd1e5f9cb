/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Draw the lungs: project the vertices, find the nearest triangle at each sample, and shade it. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"
#include "base/parallel.h"
#include "base/vec3.h"
#include "program/view/render/render.h"

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
  if (view != SUPINE_VIEW_LYING || fabs(gravity[2]) > 0.8) {
    return;
  }
  const double flat = sqrt(1 - gravity[2] * gravity[2]);
  for (size_t k = 0; k < 3; ++k) {
    axes[1][k] = -gravity[k];
    axes[0][k] = ((k == 2 ? -1 : 0) + gravity[2] * gravity[k]) / flat; /* towards the feet */
  }
  supine_cross(axes[0], axes[1], axes[2]);
}

enum { SIDE_MAX = 16384, SHADES = 4096, NO_TRIANGLE = UINT32_MAX, ROWS_PER_JOB = 16 };
enum { OVERSAMPLE = 2 }; /* each pixel is the mean of OVERSAMPLE x OVERSAMPLE samples */

/* Distances, in half diagonals of the lungs' bounding box. */
static const double viewer_distance = 5.0; /* from the viewer to the centre of the lungs */
static const double drawn_depth = 3.0;     /* largest distance from the centre towards the viewer at
                                              which points are drawn, in radii */
static const double margin = 1.03; /* size of the picture divided by the size of the lungs in it */
static const float gamma_exponent = 2.2F;

typedef struct corner {
  float x, y;      /* position, samples from the left and upper edges of the picture */
  float nearness;  /* 1 / (depth from the viewer), 1/mm; 0 if too near to be drawn */
  float normal[3]; /* unit normal in the viewer's axes: right, up, towards the viewer */
  float eye[3];    /* vector from the vertex to the viewer, mm, in the viewer's axes */
  float value;
} corner;

void supine_render_box(const float *xyz, size_t count, double low[3], double high[3]) {
  for (size_t i = 0; i < 3 * count; ++i) {
    low[i % 3] = fmin(low[i % 3], (double)xyz[i]);
    high[i % 3] = fmax(high[i % 3], (double)xyz[i]);
  }
}

/* A viewer, who looks at the centre of the reference surface in every state. */
typedef struct camera {
  double axes[3][3];
  double centre[3];
  double radius; /* half the diagonal of the bounding box of the reference surface, mm */
  double away;   /* distance from the viewer to the centre, mm */
} camera;

static camera find_camera(const supine_basis_info *info, const supine_scene *scene) {
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
  const camera c = find_camera(info, scene);
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

/* Fit the lungs into the picture. Set frame[0] and frame[1] to the centre of their extent, mm, and
 * frame[2] and frame[3] to the scales, in half widths and half heights of the picture per mm. */
static void find_frame(const supine_basis *basis, const supine_scene *scene, double frame[4]) {
  double extent[4] = SUPINE_EXTENT_NONE;
  if (scene->extent != NULL) {
    memcpy(extent, scene->extent, sizeof extent);
  } else {
    supine_render_extent(basis, scene, extent);
  }
  const double aspect = (double)scene->width / (double)scene->height;
  const double wide = fmax(1e-3, margin * (extent[1] - extent[0]) / 2);
  const double high = fmax(1e-3, margin * (extent[3] - extent[2]) / 2);
  const double tall = fmax(high, wide / aspect);
  frame[0] = (extent[0] + extent[1]) / 2;
  frame[1] = (extent[2] + extent[3]) / 2;
  frame[2] = 1 / (tall * aspect);
  frame[3] = 1 / tall;
}

/* Project a point `p` in the viewer's axes, mm, to a position `at`, measured from the left and
 * upper edges of a picture of `size` pixels or samples. */
static void project(const camera *c, const double frame[4], const double p[3], const double size[2],
                    double at[2]) {
  for (int side = 0; side < 2; ++side) {
    const double off = (p[side] * c->away / (c->away - p[2]) - frame[side]) * frame[2 + side];
    at[side] = 0.5 * (1 + (side == 0 ? off : -off)) * size[side];
  }
}

void supine_render_project(const supine_basis *basis, const supine_scene *scene,
                           const supine_marks *marks, bool from, double (*pixel)[2]) {
  const camera c = find_camera(supine_basis_get_info(basis), scene);
  const double size[2] = {(double)scene->width, (double)scene->height};
  double frame[4];
  find_frame(basis, scene, frame);
  for (size_t i = 0; i < marks->count; ++i) {
    double p[3];
    place(&c, from ? marks->mark[i].from : marks->mark[i].xyz, p);
    project(&c, frame, p, size, pixel[i]);
  }
}

typedef struct canvas {
  const supine_basis_info *info;
  const supine_scene *scene;
  corner *corners;                  /* [N] the projected vertices */
  size_t width, height;             /* size of the picture, samples */
  uint32_t *nearest;                /* [height, width] nearest triangle, or NO_TRIANGLE */
  float *nearness;                  /* [height, width] 1 / (depth of the nearest triangle), 1/mm */
  float colours[SHADES + 1][3];     /* colour map, linear RGB, 0 to 1 */
  unsigned char encode[SHADES + 1]; /* [i] byte that encodes the linear light i / SHADES */
  float line_step;                  /* difference of the value between contour lines, mm */
  uint32_t *pixels;
} canvas;

/* Project the vertices of the deformed surface. */
static supine_status find_corners(const canvas *c, const supine_basis *basis, supine_error *error) {
  const size_t n = c->info->vertex_count;
  const camera cam = find_camera(c->info, c->scene);
  const double size[2] = {(double)c->width, (double)c->height};
  const double near = cam.away - drawn_depth * cam.radius;
  double frame[4];
  SUPINE_ARENA arena = {0};
  float *xyz = supine_arena_take(&arena, 3 * n, sizeof *xyz);
  float *normals = supine_arena_take(&arena, 3 * n, sizeof *normals);
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu vertices", n));
  find_frame(basis, c->scene, frame);
  (void)supine_deform(basis, c->scene->pose, xyz);
  supine_normals(basis, xyz, normals);
  for (size_t i = 0; i < n; ++i) {
    const double normal[3] = {(double)normals[3 * i], (double)normals[3 * i + 1],
                              (double)normals[3 * i + 2]};
    double p[3];
    double seen[3];
    double at[2];
    place(&cam, xyz + 3 * i, p);
    turn(&cam, normal, seen);
    project(&cam, frame, p, size, at);
    const double away = cam.away - p[2];
    c->corners[i] = (corner){.x = (float)at[0],
                             .y = (float)at[1],
                             .nearness = away > near ? (float)(1.0 / away) : 0.0F,
                             .normal = {(float)seen[0], (float)seen[1], (float)seen[2]},
                             .eye = {(float)-p[0], (float)-p[1], (float)away},
                             .value = c->scene->value[i]};
  }
  return SUPINE_OK;
}

typedef struct face {
  const corner *at[3];
  float area; /* twice the triangle's area, samples^2; negative if seen from inside the lung */
} face;

static face face_of(const canvas *c, size_t triangle) {
  const uint32_t *v = c->info->triangles + 3 * triangle;
  const corner *all = c->corners;
  face f = {{&all[v[0]], &all[v[1]], &all[v[2]]}, 0.0F};
  f.area = (f.at[2]->x - f.at[0]->x) * (f.at[1]->y - f.at[0]->y) -
           (f.at[1]->x - f.at[0]->x) * (f.at[2]->y - f.at[0]->y);
  return f;
}

/* Compute the barycentric coordinates of the position (x, y), in samples, in a triangle. */
static void shares_at(const face *f, float x, float y, float share[3]) {
  for (int k = 0; k < 3; ++k) {
    const corner *a = f->at[(k + 1) % 3];
    const corner *b = f->at[(k + 2) % 3];
    share[k] = ((b->x - x) * (a->y - y) - (a->x - x) * (b->y - y)) / f->area;
  }
}

static float nearness_at(const face *f, const float share[3]) {
  return share[0] * f->at[0]->nearness + share[1] * f->at[1]->nearness +
         share[2] * f->at[2]->nearness;
}

/* Record a triangle in rows `begin` to `end` - 1, at samples where it is the nearest so far. */
static void draw_face(const canvas *c, size_t triangle, size_t begin, size_t end) {
  const face f = face_of(c, triangle);
  const float left = fminf(f.at[0]->x, fminf(f.at[1]->x, f.at[2]->x));
  const float right = fmaxf(f.at[0]->x, fmaxf(f.at[1]->x, f.at[2]->x));
  const float top = fminf(f.at[0]->y, fminf(f.at[1]->y, f.at[2]->y));
  const float bottom = fmaxf(f.at[0]->y, fmaxf(f.at[1]->y, f.at[2]->y));
  if (!(f.area != 0.0F) || !(bottom >= (float)begin && top <= (float)end) ||
      !(right >= 0.0F && left <= (float)c->width)) {
    return;
  }
  const size_t first = top > (float)begin ? (size_t)top : begin;
  const size_t last = bottom < (float)end ? (size_t)bottom + 1 : end;
  const size_t from = left > 0.0F ? (size_t)left : 0;
  const size_t to = right < (float)c->width ? (size_t)right + 1 : c->width;
  for (size_t y = first; y < last && y < end; ++y) {
    for (size_t x = from; x < to && x < c->width; ++x) {
      float share[3];
      shares_at(&f, (float)x + 0.5F, (float)y + 0.5F, share);
      const float nearness = nearness_at(&f, share);
      const size_t at = y * c->width + x;
      if (share[0] >= 0.0F && share[1] >= 0.0F && share[2] >= 0.0F && nearness > c->nearness[at]) {
        c->nearness[at] = nearness;
        c->nearest[at] = (uint32_t)triangle;
      }
    }
  }
}

static float smoothstep(float low, float high, float x) {
  const float t = fminf(1.0F, fmaxf(0.0F, (x - low) / (high - low)));
  return t * t * (3.0F - 2.0F * t);
}

static float dot(const float a[3], const float b[3]) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void normalise(float v[3]) {
  const float length = sqrtf(dot(v, v));
  for (int k = 0; k < 3; ++k) {
    v[k] /= length > 0.0F ? length : 1.0F;
  }
}

static float value_at(const face *f, float x, float y) {
  float share[3];
  shares_at(f, x, y, share);
  return (share[0] * f->at[0]->nearness * f->at[0]->value +
          share[1] * f->at[1]->nearness * f->at[1]->value +
          share[2] * f->at[2]->nearness * f->at[2]->value) /
         nearness_at(f, share);
}

/* Return the share of a sample that contour lines cover, 0 to 1. */
static float contour(const face *f, float x, float y, float value, float spacing) {
  const float steps = value / spacing;
  const float width =
      (fabsf(value_at(f, x + 1.0F, y) - value) + fabsf(value_at(f, x, y + 1.0F) - value)) / spacing;
  const float middle = steps - 0.5F;
  const float away = fabsf(middle - floorf(middle) - 0.5F) / fmaxf(width, 1e-6F);
  return steps < 0.5F
             ? 0.0F
             : (1.0F - smoothstep(0.5F, 1.7F, away)) * (1.0F - smoothstep(0.3F, 0.8F, width));
}

/* Return the diffuse light, 0 to 1, on a surface with unit normal `n` from the direction `from`, a
 * vector of any length. */
static float lambert(const float n[3], const float from[3]) {
  float to[3] = {from[0], from[1], from[2]};
  normalise(to);
  return fmaxf(0.0F, dot(n, to));
}

/* Compute the colour of a triangle at a sample: premultiplied RGB and coverage, 0 to 255. */
static void shade(const canvas *c, size_t triangle, float x, float y, unsigned char rgba[4]) {
  static const float key[3] = {-0.55F, 0.75F, 0.8F};
  static const float fill[3] = {0.9F, -0.1F, 0.5F};
  const supine_scene *scene = c->scene;
  const face f = face_of(c, triangle);
  float share[3];
  float n[3] = {0.0F, 0.0F, 0.0F};
  float eye[3] = {0.0F, 0.0F, 0.0F};
  float half[3] = {key[0], key[1], key[2]};
  shares_at(&f, x, y, share);
  for (int k = 0; k < 3; ++k) {
    for (int v = 0; v < 3; ++v) {
      const float weight = share[v] * f.at[v]->nearness;
      n[k] += weight * f.at[v]->normal[k] * (f.area > 0.0F ? 1.0F : -1.0F);
      eye[k] += weight * f.at[v]->eye[k];
    }
  }
  normalise(n);
  normalise(eye);
  normalise(half);
  for (int k = 0; k < 3; ++k) {
    half[k] += eye[k];
  }
  const float value = value_at(&f, x, y);
  const float facing = fmaxf(0.0F, dot(n, eye));
  float light = 0.46F + 0.14F * n[1] + 0.58F * lambert(n, key) + 0.16F * lambert(n, fill);
  light *= 0.72F + 0.28F * smoothstep(0.0F, 0.45F, facing); /* darken the outline */
  light *= 1.0F - 0.275F * contour(&f, x, y, value, c->line_step);
  if (scene->shell) {
    const float cover = 0.12F + 0.7F * powf(1.0F - facing, 2.5F);
    rgba[3] = (unsigned char)lrintf(255.0F * cover);
    memset(rgba, (int)lrintf(cover * 70.0F), 3);
    return;
  }
  rgba[3] = 255;
  const float shine = 0.08F * powf(lambert(n, half), 48.0F);
  const float t = fminf(1.0F, fmaxf(0.0F, value / (float)scene->largest));
  const float *base = c->colours[(size_t)lrintf(t * SHADES)];
  for (int k = 0; k < 3; ++k) {
    const float lit = base[k] * light + shine;
    rgba[k] = c->encode[(size_t)lrintf(fminf(1.0F, fmaxf(0.0F, lit)) * SHADES)];
  }
}

/* Return the mean of a pixel's samples as premultiplied ARGB; samples without lungs count as 0. */
static uint32_t mean_of(const canvas *c, size_t x, size_t y) {
  enum { COUNT = OVERSAMPLE * OVERSAMPLE };
  uint32_t sum[4] = {COUNT / 2, COUNT / 2, COUNT / 2, COUNT / 2};
  for (size_t sub = 0; sub < COUNT; ++sub) {
    const size_t row = OVERSAMPLE * y + sub / OVERSAMPLE;
    const size_t column = OVERSAMPLE * x + sub % OVERSAMPLE;
    const uint32_t triangle = c->nearest[row * c->width + column];
    unsigned char rgba[4];
    if (triangle != NO_TRIANGLE) {
      shade(c, triangle, (float)column + 0.5F, (float)row + 0.5F, rgba);
      for (int k = 0; k < 4; ++k) {
        sum[k] += rgba[k];
      }
    }
  }
  return (sum[3] / COUNT) << 24 | (sum[0] / COUNT) << 16 | (sum[1] / COUNT) << 8 | sum[2] / COUNT;
}

static void draw_rows(void *context, size_t begin, size_t end, size_t thread) {
  const canvas *c = context;
  const supine_basis_info *info = c->info;
  const corner *corners = c->corners;
  (void)thread;
  for (size_t t = 0; t < info->triangle_count; ++t) {
    const uint32_t *v = info->triangles + 3 * t;
    if (corners[v[0]].nearness > 0.0F && corners[v[1]].nearness > 0.0F &&
        corners[v[2]].nearness > 0.0F) {
      draw_face(c, t, OVERSAMPLE * begin, OVERSAMPLE * end);
    }
  }
  for (size_t y = begin; y < end; ++y) {
    for (size_t x = 0; x < c->scene->width; ++x) {
      c->pixels[y * c->scene->width + x] = mean_of(c, x, y);
    }
  }
}

static void find_colours(canvas *c) {
  for (int i = 0; i <= SHADES; ++i) {
    const float share = (float)i / SHADES;
    double rgb[3];
    supine_render_colour(c->scene->colours, (double)share, rgb);
    for (int k = 0; k < 3; ++k) {
      c->colours[i][k] = powf((float)rgb[k], gamma_exponent);
    }
    c->encode[i] = (unsigned char)lrintf(255.0F * powf(share, 1.0F / gamma_exponent));
  }
}

supine_status supine_render_draw(const supine_basis *basis, const supine_scene *scene,
                                 uint32_t *pixels, supine_error *error) {
  SUPINE_REFUSE_IF(scene->width == 0 || scene->height == 0 || scene->width > SIDE_MAX ||
                       scene->height > SIDE_MAX,
                   error, SUPINE_ERROR_ARGUMENT,
                   "%zu x %zu pixels cannot be drawn: give sides of 1 to %d pixels", scene->width,
                   scene->height, SIDE_MAX);
  SUPINE_ARENA arena = {0};
  const size_t count = OVERSAMPLE * OVERSAMPLE * scene->width * scene->height;
  const supine_basis_info *info = supine_basis_get_info(basis);
  canvas c = {.info = info,
              .corners = supine_arena_take(&arena, info->vertex_count, sizeof *c.corners),
              .scene = scene,
              .width = OVERSAMPLE * scene->width,
              .height = OVERSAMPLE * scene->height,
              .nearest = supine_arena_take(&arena, count, sizeof *c.nearest),
              .nearness = supine_arena_zeros(&arena, count, sizeof *c.nearness),
              .line_step = (float)supine_render_bar_step(scene->largest),
              .pixels = pixels};
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu samples", count));
  memset(c.nearest, 0xFF, count * sizeof *c.nearest);
  find_colours(&c);
  SUPINE_TRY(find_corners(&c, basis, error));
  supine_parallel_for(scene->height, ROWS_PER_JOB, 0, draw_rows, &c);
  return SUPINE_OK;
}
