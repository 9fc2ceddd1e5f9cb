/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Draw names, rings and arrows of the structures inside the lungs. */
#include "program/view/render/marks.h"

#include <float.h>
#include <string.h>

#include "base/arena.h"
#include "base/library.h"

/* clang-format off */
#define FUNCTIONS(EACH)                                                                            \
  EACH(cairo_, arc) EACH(cairo_, close_path) EACH(cairo_, fill) EACH(cairo_, fill_preserve)        \
  EACH(cairo_, line_to) EACH(cairo_, move_to) EACH(cairo_, new_path) EACH(cairo_, rectangle)       \
  EACH(cairo_, set_dash) EACH(cairo_, set_line_join)                                               \
  EACH(cairo_, set_line_width) EACH(cairo_, set_source_rgb) EACH(cairo_, set_source_rgba)          \
  EACH(cairo_, stroke) EACH(cairo_, stroke_preserve)
/* clang-format on */

static struct { FUNCTIONS(SUPINE_LIBRARY_MEMBER) } cairo;

static const double pi = 3.14159265358979323846;
static const double name_size = 0.68; /* height of names, in heights of the picture's letters */
static const double least_ball = 4.0; /* smallest radius of a ball, pixels, as in draw.c */

/* A mark with a label: where it is drawn, and where its name is. All lengths are pixels. */
typedef struct shown {
  const supine_mark *mark;
  double at[2], from[2];
  double radius; /* of the ball, or of a circle around the mesh */
  double ring;   /* radius of the ball and the expected error around it; 0 for no ring */
  bool arrow;    /* whether it moved by more than its radius */
  double box[4]; /* of the name: left, top, right, bottom */
} shown;

/* What draws the marks of a scene. */
typedef struct sketch {
  cairo_t *cr;
  const marks_style *style;
  letters face; /* of names */
  double width, height;
  size_t count;
  shown *mark;       /* [count] */
  size_t ball_count; /* targets without a name */
  double (*ball)[3]; /* [ball_count] position and radius */
} sketch;

supine_status supine_render_marks_load(supine_error *error) {
  SUPINE_TRY(supine_render_letters_load(error));
  return SUPINE_LIBRARY_LOAD(SUPINE_CAIRO, FUNCTIONS, &cairo, error);
}

static void colour(cairo_t *cr, const double rgb[3]) {
  cairo.set_source_rgb(cr, rgb[0], rgb[1], rgb[2]);
}

void supine_render_arrow(cairo_t *cr, const double from[2], const double to[2], double head,
                         double line) {
  const double length = hypot(to[0] - from[0], to[1] - from[1]);
  const double dx = (to[0] - from[0]) / length;
  const double dy = (to[1] - from[1]) / length;
  cairo.set_line_width(cr, line);
  cairo.move_to(cr, from[0], from[1]);
  cairo.line_to(cr, to[0] - 0.8 * head * dx, to[1] - 0.8 * head * dy);
  cairo.stroke(cr);
  cairo.move_to(cr, to[0], to[1]);
  cairo.line_to(cr, to[0] - head * dx - 0.5 * head * dy, to[1] - head * dy + 0.5 * head * dx);
  cairo.line_to(cr, to[0] - head * dx + 0.5 * head * dy, to[1] - head * dy - 0.5 * head * dx);
  cairo.close_path(cr);
  cairo.fill(cr);
}

/* Draw the expected error around the ball of a target, in the plane of the picture and to scale. */
static void ring(const sketch *s, const shown *m) {
  const double *rgb = s->style->target;
  cairo.new_path(s->cr);
  cairo.arc(s->cr, m->at[0], m->at[1], m->ring, 0, 2 * pi);
  cairo.set_source_rgba(s->cr, rgb[0], rgb[1], rgb[2], 0.18);
  cairo.fill_preserve(s->cr);
  cairo.set_source_rgba(s->cr, rgb[0], rgb[1], rgb[2], 0.95);
  cairo.set_line_width(s->cr, fmax(1.0, 0.07 * s->style->font));
  cairo.stroke(s->cr);
}

/* Draw a dashed circle where the target was. */
static void ghost(const sketch *s, const shown *m) {
  const double dash[2] = {0.16 * s->style->font, 0.14 * s->style->font};
  cairo.new_path(s->cr);
  cairo.arc(s->cr, m->from[0], m->from[1], m->radius, 0, 2 * pi);
  colour(s->cr, s->style->ink);
  cairo.set_line_width(s->cr, fmax(1.0, 0.075 * s->style->font));
  cairo.set_dash(s->cr, dash, 2, 0.0);
  cairo.stroke(s->cr);
  cairo.set_dash(s->cr, dash, 0, 0.0);
}

/* Draw an arrow over the balls, with an edge in the colour of the ground, so that it is seen on any
 * of them. */
static void arrow(const sketch *s, const shown *m) {
  const double moved = hypot(m->at[0] - m->from[0], m->at[1] - m->from[1]);
  const double font = s->style->font;
  const double head = fmin(0.5 * font, 0.6 * moved);
  colour(s->cr, s->style->ground);
  supine_render_arrow(s->cr, m->from, m->at, 1.35 * head, 0.26 * font);
  colour(s->cr, s->style->ink);
  supine_render_arrow(s->cr, m->from, m->at, head, 0.12 * font);
}

/* Return the distance of a point from a box; 0 inside. */
static double box_distance(const double box[4], const double at[2]) {
  const double x = fmax(0.0, fmax(box[0] - at[0], at[0] - box[2]));
  const double y = fmax(0.0, fmax(box[1] - at[1], at[1] - box[3]));
  return hypot(x, y);
}

/* Set `end` to the point of a box that is nearest to `at`. */
static void nearest_of(const double box[4], const double at[2], double end[2]) {
  end[0] = fmin(box[2], fmax(box[0], at[0]));
  end[1] = fmin(box[3], fmax(box[1], at[1]));
}

/* Return the distance of a point from the line from `a` to `b`. */
static double line_distance(const double a[2], const double b[2], const double at[2]) {
  const double d[2] = {b[0] - a[0], b[1] - a[1]};
  const double square = fmax(1e-12, d[0] * d[0] + d[1] * d[1]);
  const double along = ((at[0] - a[0]) * d[0] + (at[1] - a[1]) * d[1]) / square;
  const double share = fmin(1.0, fmax(0.0, along));
  return hypot(a[0] + share * d[0] - at[0], a[1] + share * d[1] - at[1]);
}

/* Return whether the line from `a` to `b` crosses a box, at one of some points along it. */
static bool crosses(const double a[2], const double b[2], const double box[4]) {
  enum { POINTS = 24 };
  for (int i = 0; i <= POINTS; ++i) {
    const double share = (double)i / POINTS;
    const double at[2] = {a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])};
    if (box_distance(box, at) <= 0.0) {
      return true;
    }
  }
  return false;
}

/* Return twice the signed area of the triangle a, b, c. */
static double turn(const double a[2], const double b[2], const double c[2]) {
  return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

/* Return whether the lines from `a` to `b` and from `c` to `d` cross. */
static bool lines_cross(const double a[2], const double b[2], const double c[2],
                        const double d[2]) {
  return turn(a, b, c) * turn(a, b, d) < 0.0 && turn(c, d, a) * turn(c, d, b) < 0.0;
}

/* Return whether a mark is that of a large structure, on which its name is written. */
static bool is_shell(const shown *m) {
  return m->mark->kind == SUPINE_MARK_ANATOMY;
}

/* Return what a name in `box` would hide: the heading, balls, rings and ghosts, names that were
 * placed before it and their lines, and what the line to its mark would cross. */
static double cost_of(const sketch *s, size_t own, const double box[4]) {
  const double gap = 0.15 * s->style->font;
  double end[2];
  double cost = 0.0;
  nearest_of(box, s->mark[own].at, end);
  for (size_t i = 0; i < s->ball_count; ++i) {
    cost += box_distance(box, s->ball[i]) < s->ball[i][2] ? 0.5 : 0.0;
  }
  for (size_t i = 0; i < s->count; ++i) {
    const shown *m = &s->mark[i];
    cost += !is_shell(m) && box_distance(box, m->at) < fmax(m->radius, m->ring) + gap;
    cost += m->arrow && box_distance(box, m->from) < m->radius + gap;
    cost +=
        i != own && !is_shell(m) && line_distance(s->mark[own].at, end, m->at) < m->radius + gap;
    if (i < own) {
      const bool apart = box[0] > m->box[2] + gap || m->box[0] > box[2] + gap ||
                         box[1] > m->box[3] + gap || m->box[1] > box[3] + gap;
      double other[2];
      nearest_of(m->box, m->at, other);
      cost += apart ? 0.0 : 16.0;
      cost += crosses(s->mark[own].at, end, m->box) ? 2.0 : 0.0;
      cost += crosses(m->at, other, box) ? 2.0 : 0.0;
      cost += lines_cross(s->mark[own].at, end, m->at, other) ? 2.0 : 0.0;
    }
  }
  const bool inside = box[0] >= 0.0 && box[2] <= s->width && box[1] >= 0.0 && box[3] <= s->height;
  const bool free = box[0] >= s->style->heading[0] || box[1] >= s->style->heading[1];
  return cost + (inside && free ? 0.0 : 16.0);
}

/* Return the width of a name, with the square in its colour before that of a large structure. */
static double width_of(const sketch *s, const shown *m) {
  return supine_render_letters_width(s->cr, &s->face, m->mark->label) +
         (is_shell(m) ? s->face.size : 0.0);
}

/* Place the name of a mark where it hides least, near its mark and rather beside it; on its mark,
 * if that is a large structure. */
static void place(const sketch *s, size_t own) {
  enum { WAYS = 16, STEPS = 10 };
  shown *m = &s->mark[own];
  const double font = s->style->font;
  const double edge = 0.3 * font; /* space beside names at the edges of the picture */
  const double width = width_of(s, m);
  const double start = is_shell(m) ? 0.0 : fmax(m->radius, m->ring) + 0.5 * font;
  double best = DBL_MAX;
  for (int way = 0; way < WAYS; ++way) {
    const double angle = 2 * pi * way / WAYS;
    for (int step = 0; step < STEPS; ++step) {
      const double away = start + 0.8 * font * step;
      const double x = m->at[0] + away * cos(angle);
      const double y = m->at[1] - away * sin(angle);
      double beside = cos(angle) >= 0.0 ? x : x - width;
      if (is_shell(m)) {
        beside = x - width / 2;
      }
      const double left = fmax(edge, fmin(beside, s->width - width - edge));
      const double box[4] = {left, y - 0.55 * s->face.size, left + width, y + 0.55 * s->face.size};
      const double cost = cost_of(s, own, box) + 0.12 * step + 0.1 * fabs(sin(angle));
      if (cost < best) {
        best = cost;
        memcpy(m->box, box, sizeof box);
      }
    }
  }
}

static void name(const sketch *s, const shown *m) {
  const double size = s->face.size;
  const double *ground = s->style->ground;
  double end[2];
  nearest_of(m->box, m->at, end);
  const double length = hypot(end[0] - m->at[0], end[1] - m->at[1]);
  colour(s->cr, s->style->faint);
  cairo.set_line_width(s->cr, fmax(0.8, 0.06 * size));
  if (length > m->radius + 0.3 * size) {
    const double share = (m->radius + 0.1 * size) / length;
    cairo.move_to(s->cr, m->at[0] + share * (end[0] - m->at[0]),
                  m->at[1] + share * (end[1] - m->at[1]));
    cairo.line_to(s->cr, end[0], end[1]);
    cairo.stroke(s->cr);
  }
  const double middle = (m->box[1] + m->box[3]) / 2;
  const double left = m->box[2] - supine_render_letters_width(s->cr, &s->face, m->mark->label);
  supine_render_letters_path(s->cr, &s->face, left, middle + 0.35 * size, m->mark->label);
  cairo.set_source_rgba(s->cr, ground[0], ground[1], ground[2], 0.85);
  cairo.set_line_width(s->cr, size * 0.25);
  cairo.set_line_join(s->cr, CAIRO_LINE_JOIN_ROUND); /* a mitre would grow spikes on an M */
  cairo.stroke_preserve(s->cr);
  colour(s->cr, s->style->ink);
  cairo.fill(s->cr);
  if (is_shell(m)) {
    const uint32_t tint = supine_render_palette(SUPINE_PALETTE_ANATOMY, m->mark->tint);
    cairo.rectangle(s->cr, m->box[0], middle - 0.3 * size, 0.6 * size, 0.6 * size);
    cairo.set_source_rgb(s->cr, (tint >> 16) / 255.0, (tint >> 8 & 255U) / 255.0,
                         (tint & 255U) / 255.0);
    cairo.fill(s->cr);
  }
}

/* Project the marks, and fill s->mark [count] with those that have a label, the selected one first
 * and those of large structures last, and s->ball [ball_count]. */
static void project(sketch *s, const supine_basis *basis, const supine_scene *scene,
                    double (*pixel)[3]) {
  const supine_marks *all = scene->content;
  double(*from)[3] = pixel + all->count;
  supine_render_project(basis, scene, all, false, pixel);
  supine_render_project(basis, scene, all, true, from);
  for (size_t n = 0; n < 2 * all->count; ++n) {
    const size_t i = n % all->count;
    const supine_mark *mark = &all->mark[i];
    const bool shell = mark->kind == SUPINE_MARK_ANATOMY;
    if (n < all->count && !shell && mark->radius > 0.0F) {
      double *ball = s->ball[s->ball_count++];
      memcpy(ball, pixel[i], 2 * sizeof *ball);
      ball[2] = fmax(least_ball, (double)mark->radius * pixel[i][2]);
    }
    if (mark->label != NULL && shell == (n >= all->count)) {
      const double moved = hypot(pixel[i][0] - from[i][0], pixel[i][1] - from[i][1]);
      const double radius = fmax(least_ball, (double)mark->reach * pixel[i][2]);
      const bool ringed = mark->kind == SUPINE_MARK_SELECTED && mark->expected > 0.0F;
      s->mark[s->count++] =
          (shown){.mark = mark,
                  .at = {pixel[i][0], pixel[i][1]},
                  .from = {from[i][0], from[i][1]},
                  .radius = radius,
                  .ring = ringed ? (double)(mark->reach + mark->expected) * pixel[i][2] : 0.0,
                  .arrow = mark->moved && moved > radius && mark->kind != SUPINE_MARK_ANATOMY};
    }
  }
  for (size_t i = 0; i < s->count; ++i) {
    if (s->mark[i].mark->kind == SUPINE_MARK_SELECTED) {
      const shown selected = s->mark[i];
      s->mark[i] = s->mark[0];
      s->mark[0] = selected;
    }
  }
}

supine_status supine_render_marks_draw(cairo_t *cr, const marks_style *style,
                                       const supine_basis *basis, const supine_scene *scene) {
  const size_t count = scene->content->count;
  SUPINE_ARENA arena = {0};
  sketch s = {.cr = cr,
              .style = style,
              .face = {name_size * style->font, false},
              .width = (double)scene->width,
              .height = (double)scene->height,
              .mark = supine_arena_take(&arena, count, sizeof *s.mark),
              .ball = supine_arena_take(&arena, count, sizeof *s.ball)};
  double(*pixel)[3] = supine_arena_take(&arena, count, 2 * sizeof *pixel);
  if (arena.failed) {
    return SUPINE_ERROR_MEMORY;
  }
  project(&s, basis, scene, pixel);
  for (size_t i = 0; i < s.count; ++i) {
    const shown *m = &s.mark[i];
    if (m->ring > 0.0) {
      ring(&s, m);
    }
    if (m->mark->moved && m->mark->kind == SUPINE_MARK_SELECTED) {
      ghost(&s, m);
    }
    if (m->arrow) {
      arrow(&s, m);
    }
  }
  for (size_t i = 0; i < s.count; ++i) {
    place(&s, i);
    name(&s, &s.mark[i]);
  }
  return SUPINE_OK;
}
