/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Draw the lungs and what is inside them: opaque surfaces by the nearest triangle at each sample,
 * then translucent ones from the farthest to the nearest. */
#include <math.h>
#include <string.h>

#include "base/arena.h"
#include "base/parallel.h"
#include "base/vec3.h"
#include "program/view/render/canvas.h"

enum { SIDE_MAX = 16384, ROWS_PER_JOB = 16 };

static const float ball_pixels = 4.0F; /* smallest radius of a ball, pixels */

/* Surfaces that are drawn. */
typedef enum layer_name {
  LAYER_LUNGS,
  LAYER_NOW,
  LAYER_BEFORE,
  LAYER_BODY,
  LAYER_COUNT
} layer_name;

typedef struct layer {
  const corner *corners;
  const uint32_t *triangles;
  size_t triangle_count;
} layer;

/* A translucent triangle of a layer, or the ball around its corner. */
typedef struct item {
  float nearness;
  uint32_t index; /* of the triangle or the corner */
  layer_name layer;
  bool ball;
} item;

typedef struct canvas {
  const supine_scene *scene;
  camera camera;
  size_t width, height; /* size of the picture, samples */
  layer layers[LAYER_COUNT];
  size_t item_count;
  item *items;      /* [item_count] translucent triangles and balls, the farthest first */
  float *nearness;  /* [height, width] 1 / (depth of the nearest opaque surface), 1/mm */
  float (*rgba)[4]; /* [height, width] premultiplied colour and coverage, 0 to 1 */
  float line_step;  /* difference of the value between contour lines, mm */
  shades *shades;
  uint32_t *pixels;
} canvas;

/* Rows of samples that a thread draws. */
typedef struct rows {
  size_t begin, end;
} rows;

typedef struct face {
  const corner *at[3];
  float area; /* twice the triangle's area, samples^2; negative if seen from inside the lung */
} face;

static face face_of(const layer *l, size_t triangle) {
  const uint32_t *v = l->triangles + 3 * triangle;
  const corner *all = l->corners;
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

static float smoothstep(float low, float high, float x) {
  const float t = fminf(1.0F, fmaxf(0.0F, (x - low) / (high - low)));
  return t * t * (3.0F - 2.0F * t);
}

static void normalise(float v[3]) {
  const float length = sqrtf(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
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

/* Interpolate the corners of a triangle. */
static fragment fragment_at(const face *f, const float share[3]) {
  fragment at = {.value = 0.0F};
  float sum = 0.0F;
  for (int v = 0; v < 3; ++v) {
    const float weight = share[v] * f->at[v]->nearness;
    sum += weight;
    at.value += weight * f->at[v]->value;
    at.height += weight * f->at[v]->height;
    for (int k = 0; k < 3; ++k) {
      at.normal[k] += weight * f->at[v]->normal[k] * (f->area > 0.0F ? 1.0F : -1.0F);
      at.eye[k] += weight * f->at[v]->eye[k];
    }
  }
  at.value /= sum;
  at.height /= sum;
  normalise(at.normal);
  normalise(at.eye);
  return at;
}

/* What a surface is painted with. */
typedef struct paint {
  material what;
  size_t tint; /* index of the colour of anatomy */
} paint;

/* Return how much of the torso is seen at a sample, 0 to 1: it fades towards the picture's edges,
 * so that it is not cut off there. */
static float fade_at(const canvas *c, size_t sample) {
  static const float share = 0.18F; /* part of the width and the height over which it fades */
  const float x = ((float)(sample % c->width) + 0.5F) / (float)c->width;
  const float y = ((float)(sample / c->width) + 0.5F) / (float)c->height;
  return smoothstep(0.0F, share, fminf(x, 1.0F - x)) * smoothstep(0.0F, share, fminf(y, 1.0F - y));
}

/* Draw a fragment over what the sample shows. Only opaque fragments hide what is behind them, and
 * what is translucent covers them less, so that a target stays bright behind several lobes; of the
 * torso, which is drawn first, only the nearest fragment stays. */
static void blend(const canvas *c, size_t sample, material what, const fragment *at,
                  float nearness) {
  static const float veil = 0.4F; /* share of a translucent fragment that covers an opaque one */
  float rgba[4];
  float *under = c->rgba[sample];
  const bool torso = what == MATERIAL_BODY;
  supine_render_shade(c->shades, what, at, rgba);
  const bool opaque = rgba[3] >= 1.0F;
  float share = 1.0F;
  if (torso) {
    share = fade_at(c, sample);
  } else if (!opaque && c->nearness[sample] > 0.0F) {
    share = veil;
  }
  const float left = torso ? 0.0F : 1.0F - share * rgba[3];
  for (int k = 0; k < 4; ++k) {
    under[k] = share * rgba[k] + left * under[k];
  }
  if (torso || opaque) {
    c->nearness[sample] = nearness;
  }
}

/* Set `box` to the first column, the first row, and the columns and rows after the last, of the
 * samples that a box {left, top, right, bottom} may cover. Return false if there are none. */
static bool samples_of(const canvas *c, const rows *drawn, const float edge[4], size_t box[4]) {
  if (!(edge[3] >= (float)drawn->begin && edge[1] <= (float)drawn->end) ||
      !(edge[2] >= 0.0F && edge[0] <= (float)c->width)) {
    return false;
  }
  box[0] = edge[0] > 0.0F ? (size_t)edge[0] : 0;
  box[1] = edge[1] > (float)drawn->begin ? (size_t)edge[1] : drawn->begin;
  box[2] = edge[2] < (float)c->width - 1.0F ? (size_t)edge[2] + 1 : c->width;
  box[3] = edge[3] < (float)drawn->end - 1.0F ? (size_t)edge[3] + 1 : drawn->end;
  return true;
}

static void draw_triangle(const canvas *c, const layer *from, size_t triangle, paint with,
                          const rows *drawn) {
  const face f = face_of(from, triangle);
  const corner *a = f.at[0];
  const corner *b = f.at[1];
  const corner *d = f.at[2];
  const float edge[4] = {fminf(a->x, fminf(b->x, d->x)), fminf(a->y, fminf(b->y, d->y)),
                         fmaxf(a->x, fmaxf(b->x, d->x)), fmaxf(a->y, fmaxf(b->y, d->y))};
  const bool near = a->nearness > 0.0F && b->nearness > 0.0F && d->nearness > 0.0F;
  size_t box[4];
  if (!near || f.area == 0.0F || !samples_of(c, drawn, edge, box)) {
    return;
  }
  for (size_t y = box[1]; y < box[3]; ++y) {
    for (size_t x = box[0]; x < box[2]; ++x) {
      const float at[2] = {(float)x + 0.5F, (float)y + 0.5F};
      const size_t sample = y * c->width + x;
      float share[3];
      shares_at(&f, at[0], at[1], share);
      const float nearness = nearness_at(&f, share);
      if (share[0] >= 0.0F && share[1] >= 0.0F && share[2] >= 0.0F &&
          nearness > c->nearness[sample]) {
        fragment seen = fragment_at(&f, share);
        seen.tint = with.tint;
        if (with.what == MATERIAL_MAP) {
          seen.contour = contour(&f, at[0], at[1], seen.value, c->line_step);
        }
        blend(c, sample, with.what, &seen, nearness);
      }
    }
  }
}

/* Draw a ball around a corner; in the picture it is a disc. */
static void draw_ball(const canvas *c, const corner *centre, float mm, paint with,
                      const rows *drawn) {
  const float scale = supine_render_camera_scale(&c->camera, centre);
  const float radius = fmaxf(mm * scale, OVERSAMPLE * ball_pixels);
  const float edge[4] = {centre->x - radius, centre->y - radius, centre->x + radius,
                         centre->y + radius};
  size_t box[4];
  if (!(centre->nearness > 0.0F) || !samples_of(c, drawn, edge, box)) {
    return;
  }
  for (size_t y = box[1]; y < box[3]; ++y) {
    for (size_t x = box[0]; x < box[2]; ++x) {
      const float off[2] = {((float)x + 0.5F - centre->x) / radius,
                            (centre->y - (float)y - 0.5F) / radius};
      const float square = off[0] * off[0] + off[1] * off[1];
      const size_t sample = y * c->width + x;
      if (square <= 1.0F) {
        fragment seen = {.normal = {off[0], off[1], sqrtf(1.0F - square)},
                         .eye = {0.0F, 0.0F, 1.0F},
                         .tint = with.tint};
        const float depth = 1.0F / centre->nearness - seen.normal[2] * radius / scale;
        if (1.0F / depth > c->nearness[sample]) {
          blend(c, sample, with.what, &seen, 1.0F / depth);
        }
      }
    }
  }
}

/* Return how the opaque parts of a structure are drawn. */
static material solid_of(const supine_mark *mark) {
  switch (mark->kind) {
  case SUPINE_MARK_SELECTED:
    return MATERIAL_SELECTED;
  case SUPINE_MARK_ANATOMY:
    return MATERIAL_DOT;
  case SUPINE_MARK_TARGET:
    break;
  }
  return MATERIAL_TARGET;
}

/* Draw the opaque parts of the structures inside the lungs where they are now: all balls, and the
 * meshes, without those of anatomy if they are drawn as shells. */
static void draw_content(const canvas *c, bool shells, const rows *drawn) {
  const supine_marks *marks = c->scene->content;
  const layer *now = &c->layers[LAYER_NOW];
  for (size_t t = 0; t < now->triangle_count; ++t) {
    const supine_mark *mark = &marks->mark[now->triangles[3 * t]];
    if (mark->kind != SUPINE_MARK_ANATOMY || !shells) {
      draw_triangle(c, now, t, (paint){solid_of(mark), mark->tint}, drawn);
    }
  }
  if (marks == NULL) {
    return;
  }
  for (size_t i = 0; i < marks->count; ++i) {
    const supine_mark *mark = &marks->mark[i];
    if (mark->radius > 0.0F) {
      draw_ball(c, &now->corners[i], mark->radius, (paint){solid_of(mark), mark->tint}, drawn);
    }
  }
}

/* Return what a translucent triangle or ball of a layer is painted with. */
static paint paint_of(const canvas *c, const item *it) {
  if (it->layer == LAYER_LUNGS) {
    return (paint){MATERIAL_SHELL, 0};
  }
  if (it->layer == LAYER_BEFORE) {
    return (paint){MATERIAL_GHOST, 0};
  }
  const uint32_t first = c->layers[LAYER_NOW].triangles[3 * (size_t)it->index];
  return (paint){MATERIAL_ANATOMY, c->scene->content->mark[first].tint};
}

static void forget_depth(const canvas *c, const rows *drawn) {
  memset(c->nearness + drawn->begin * c->width, 0,
         (drawn->end - drawn->begin) * c->width * sizeof *c->nearness);
}

/* Draw a translucent shell of the lungs, what is inside, and ghosts of the targets, in front of the
 * torso. */
static void draw_shell(const canvas *c, const rows *drawn) {
  const layer *torso = &c->layers[LAYER_BODY];
  for (size_t t = 0; t < torso->triangle_count; ++t) {
    draw_triangle(c, torso, t, (paint){MATERIAL_BODY, 0}, drawn);
  }
  forget_depth(c, drawn);
  draw_content(c, true, drawn);
  for (size_t i = 0; i < c->item_count; ++i) {
    const item *it = &c->items[i];
    const layer *from = &c->layers[it->layer];
    if (it->ball) {
      draw_ball(c, &from->corners[it->index], c->scene->content->mark[it->index].radius,
                paint_of(c, it), drawn);
    } else {
      draw_triangle(c, from, it->index, paint_of(c, it), drawn);
    }
  }
}

/* Draw opaque lungs in the colours of their values, and over them what is inside. */
static void draw_map(const canvas *c, const rows *drawn) {
  const layer *lungs = &c->layers[LAYER_LUNGS];
  for (size_t t = 0; t < lungs->triangle_count; ++t) {
    draw_triangle(c, lungs, t, (paint){MATERIAL_MAP, 0}, drawn);
  }
  forget_depth(c, drawn);
  draw_content(c, false, drawn);
}

/* Return the mean of a pixel's samples as premultiplied ARGB; samples without lungs count as 0. */
static uint32_t mean_of(const canvas *c, size_t x, size_t y) {
  enum { COUNT = OVERSAMPLE * OVERSAMPLE };
  float sum[4] = {0.0F, 0.0F, 0.0F, 0.0F};
  uint32_t byte[4];
  for (size_t sub = 0; sub < COUNT; ++sub) {
    const size_t row = OVERSAMPLE * y + sub / OVERSAMPLE;
    const float *rgba = c->rgba[row * c->width + OVERSAMPLE * x + sub % OVERSAMPLE];
    for (int k = 0; k < 4; ++k) {
      sum[k] += rgba[k];
    }
  }
  for (int k = 3; k >= 0; --k) {
    byte[k] = (uint32_t)lrintf(fminf(sum[k] / COUNT, 1.0F) * 255.0F);
    byte[k] = byte[k] < byte[3] ? byte[k] : byte[3];
  }
  return byte[3] << 24 | byte[0] << 16 | byte[1] << 8 | byte[2];
}

static void draw_rows(void *context, size_t begin, size_t end, size_t thread) {
  const canvas *c = context;
  const rows drawn = {OVERSAMPLE * begin, OVERSAMPLE * end};
  (void)thread;
  if (c->scene->look == SUPINE_LOOK_SHELL) {
    draw_shell(c, &drawn);
  } else {
    draw_map(c, &drawn);
  }
  for (size_t y = begin; y < end; ++y) {
    for (size_t x = 0; x < c->scene->width; ++x) {
      c->pixels[y * c->scene->width + x] = mean_of(c, x, y);
    }
  }
}

/* Set the height of each corner: 0 at the lowest vertex along gravity, 1 at the highest. */
static void set_heights(const double *gravity, size_t n, const float *xyz, corner *corners) {
  double low = INFINITY;
  double high = -INFINITY;
  if (gravity == NULL) {
    return;
  }
  for (int pass = 0; pass < 2; ++pass) {
    for (size_t i = 0; i < n; ++i) {
      const double at = -((double)xyz[3 * i] * gravity[0] + (double)xyz[3 * i + 1] * gravity[1] +
                          (double)xyz[3 * i + 2] * gravity[2]);
      low = fmin(low, at);
      high = fmax(high, at);
      corners[i].height = pass == 0 ? 0.0F : (float)((at - low) / fmax(high - low, 1e-3));
    }
  }
}

/* Project the vertices of the deformed surface. */
static supine_status add_lungs(canvas *c, const supine_basis *basis, supine_arena *keep,
                               supine_error *error) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  const size_t n = info->vertex_count;
  SUPINE_ARENA arena = {0};
  corner *corners = supine_arena_take(keep, n, sizeof *corners);
  float *xyz = supine_arena_take(&arena, 3 * n, sizeof *xyz);
  float *normals = supine_arena_take(&arena, 3 * n, sizeof *normals);
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu vertices", n));
  SUPINE_TRY(supine_arena_check(keep, error, "%zu vertices", n));
  (void)supine_deform(basis, c->scene->pose, xyz);
  supine_normals(basis, xyz, normals);
  for (size_t i = 0; i < n; ++i) {
    corners[i] = supine_render_camera_project(&c->camera, xyz + 3 * i, normals + 3 * i);
    corners[i].value = c->scene->value != NULL ? c->scene->value[i] : 0.0F;
  }
  set_heights(c->scene->gravity, n, xyz, corners);
  c->layers[LAYER_LUNGS] = (layer){corners, info->triangles, info->triangle_count};
  return SUPINE_OK;
}

/* Project the torso of the patient. */
static supine_status add_body(canvas *c, const supine_basis_info *info, supine_arena *keep,
                              supine_error *error) {
  body made;
  SUPINE_TRY(supine_render_body(info, keep, &made, error));
  corner *corners = supine_arena_take(keep, made.vertex_count, sizeof *corners);
  SUPINE_TRY(supine_arena_check(keep, error, "%zu vertices", made.vertex_count));
  for (size_t i = 0; i < made.vertex_count; ++i) {
    corners[i] = supine_render_camera_project(&c->camera, made.xyz + 3 * i, made.normals + 3 * i);
  }
  c->layers[LAYER_BODY] = (layer){corners, made.triangles, made.triangle_count};
  return SUPINE_OK;
}

/* Compute normals at marks that are corners of triangles. The array `normals` begins with zeros. */
static void find_normals(const supine_marks *marks, bool before, float *normals) {
  for (size_t t = 0; t < marks->triangle_count; ++t) {
    const uint32_t *v = marks->triangles + 3 * t;
    double x[3][3];
    double normal[3];
    for (size_t k = 0; k < 9; ++k) {
      const supine_mark *mark = &marks->mark[v[k / 3]];
      x[k / 3][k % 3] = (double)(before ? mark->from[k % 3] : mark->xyz[k % 3]);
    }
    supine_normal(x[0], x[1], x[2], normal);
    for (size_t k = 0; k < 9; ++k) {
      normals[3 * v[k / 3] + k % 3] += (float)normal[k % 3];
    }
  }
  for (size_t i = 0; i < marks->count; ++i) {
    normalise(normals + 3 * i);
  }
}

/* Project the structures inside the lungs where they are, or where they were before. */
static supine_status add_content(canvas *c, bool before, supine_arena *keep, supine_error *error) {
  const supine_marks *marks = c->scene->content;
  SUPINE_ARENA arena = {0};
  corner *corners = supine_arena_take(keep, marks->count, sizeof *corners);
  float *normals = supine_arena_zeros(&arena, 3 * marks->count, sizeof *normals);
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu points", marks->count));
  SUPINE_TRY(supine_arena_check(keep, error, "%zu points", marks->count));
  find_normals(marks, before, normals);
  for (size_t i = 0; i < marks->count; ++i) {
    const supine_mark *mark = &marks->mark[i];
    corners[i] =
        supine_render_camera_project(&c->camera, before ? mark->from : mark->xyz, normals + 3 * i);
  }
  c->layers[before ? LAYER_BEFORE : LAYER_NOW] =
      (layer){corners, marks->triangles, marks->triangle_count};
  return SUPINE_OK;
}

static uint32_t digit_of(float number, unsigned shift, uint32_t mask) {
  uint32_t bits;
  memcpy(&bits, &number, sizeof bits);
  return bits >> shift & mask;
}

/* Sort the items from the farthest to the nearest, digit by digit of the bits of their nearness: a
 * number from 0 on orders as its bits do. Return the sorted items, which are in `items` or `spare`.
 */
static item *sort_items(item *items, item *spare, size_t count) {
  enum { BITS = 11, VALUES = 1 << BITS, ALL_BITS = 32 };
  for (unsigned shift = 0; shift < ALL_BITS; shift += BITS) {
    size_t begin[VALUES + 1] = {0};
    item *sorted = spare;
    for (size_t i = 0; i < count; ++i) {
      ++begin[digit_of(items[i].nearness, shift, VALUES - 1) + 1];
    }
    for (size_t value = 0; value < VALUES; ++value) {
      begin[value + 1] += begin[value];
    }
    for (size_t i = 0; i < count; ++i) {
      sorted[begin[digit_of(items[i].nearness, shift, VALUES - 1)]++] = items[i];
    }
    spare = items;
    items = sorted;
  }
  return items;
}

/* A ghost is drawn where the selected target was, if it has moved. */
static bool has_ghost(const supine_mark *mark) {
  return mark->moved && mark->kind == SUPINE_MARK_SELECTED;
}

/* Return whether a triangle of a layer is translucent. `first` is the index of its first corner. */
static bool is_translucent(const canvas *c, layer_name name, uint32_t first) {
  if (name == LAYER_LUNGS) {
    return true;
  }
  const supine_mark *mark = &c->scene->content->mark[first];
  return name == LAYER_BEFORE ? has_ghost(mark) : mark->kind == SUPINE_MARK_ANATOMY;
}

static void add_triangles(canvas *c, layer_name name) {
  const layer *from = &c->layers[name];
  for (size_t t = 0; t < from->triangle_count; ++t) {
    const uint32_t *v = from->triangles + 3 * t;
    if (is_translucent(c, name, v[0])) {
      const float nearness = from->corners[v[0]].nearness + from->corners[v[1]].nearness +
                             from->corners[v[2]].nearness;
      c->items[c->item_count++] = (item){nearness / 3.0F, (uint32_t)t, name, false};
    }
  }
}

/* List the translucent triangles and balls of a shell from the farthest to the nearest. */
static supine_status add_items(canvas *c, supine_arena *keep, supine_error *error) {
  const supine_marks *marks = c->scene->content;
  const size_t points = marks != NULL ? marks->count : 0;
  const size_t most =
      c->layers[LAYER_LUNGS].triangle_count + 2 * c->layers[LAYER_BEFORE].triangle_count + points;
  c->items = supine_arena_take(keep, most, sizeof *c->items);
  item *spare = supine_arena_take(keep, most, sizeof *spare);
  SUPINE_TRY(supine_arena_check(keep, error, "%zu triangles", most));
  add_triangles(c, LAYER_LUNGS);
  add_triangles(c, LAYER_BEFORE);
  add_triangles(c, LAYER_NOW);
  for (size_t i = 0; i < points; ++i) {
    if (marks->mark[i].radius > 0.0F && has_ghost(&marks->mark[i])) {
      c->items[c->item_count++] =
          (item){c->layers[LAYER_BEFORE].corners[i].nearness, (uint32_t)i, LAYER_BEFORE, true};
    }
  }
  c->items = sort_items(c->items, spare, c->item_count);
  return SUPINE_OK;
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
  canvas c = {.camera = supine_render_camera(supine_basis_get_info(basis), scene),
              .scene = scene,
              .width = OVERSAMPLE * scene->width,
              .height = OVERSAMPLE * scene->height,
              .nearness = supine_arena_zeros(&arena, count, sizeof *c.nearness),
              .rgba = supine_arena_zeros(&arena, count, sizeof *c.rgba),
              .shades = supine_arena_take(&arena, 1, sizeof *c.shades),
              .line_step = (float)supine_render_bar_step(scene->largest),
              .pixels = pixels};
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu samples", count));
  supine_render_shades(scene, c.shades);
  supine_render_camera_aim(&c.camera, basis, scene, (double)c.width, (double)c.height);
  SUPINE_TRY(add_lungs(&c, basis, &arena, error));
  if (scene->content != NULL) {
    SUPINE_TRY(add_content(&c, false, &arena, error));
    SUPINE_TRY(add_content(&c, true, &arena, error));
  }
  if (scene->look == SUPINE_LOOK_SHELL) {
    SUPINE_TRY(add_body(&c, supine_basis_get_info(basis), &arena, error));
    SUPINE_TRY(add_items(&c, &arena, error));
  }
  supine_parallel_for(scene->height, ROWS_PER_JOB, 0, draw_rows, &c);
  return SUPINE_OK;
}
