/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compose pictures of postures side by side with cairo. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <cairo-pdf.h>
#include <cairo-svg.h>
#include <cairo.h>

#include "base/arena.h"
#include "base/library.h"
#include "base/number.h"
#include "base/output.h"
#include "base/text.h"
#include "program/view/render/render.h"

/* clang-format off */
#define FUNCTIONS(EACH)                                                                            \
  EACH(cairo_, arc) EACH(cairo_, close_path) EACH(cairo_, create) EACH(cairo_, destroy)            \
  EACH(cairo_, fill) EACH(cairo_, fill_preserve) EACH(cairo_, image_surface_create)                \
  EACH(cairo_, image_surface_create_for_data) EACH(cairo_, image_surface_get_data)                 \
  EACH(cairo_, image_surface_get_stride) EACH(cairo_, line_to) EACH(cairo_, move_to)               \
  EACH(cairo_, new_path) EACH(cairo_, new_sub_path) EACH(cairo_, paint)                            \
  EACH(cairo_, pattern_add_color_stop_rgb) EACH(cairo_, pdf_surface_create_for_stream)             \
  EACH(cairo_, pdf_surface_set_metadata)                                                           \
  EACH(cairo_, pattern_create_linear) EACH(cairo_, pattern_destroy) EACH(cairo_, rectangle)        \
  EACH(cairo_, restore) EACH(cairo_, save) EACH(cairo_, scale)                                     \
  EACH(cairo_, select_font_face) EACH(cairo_, set_font_size) EACH(cairo_, set_line_width)          \
  EACH(cairo_, set_source) EACH(cairo_, set_source_rgb) EACH(cairo_, set_source_rgba)              \
  EACH(cairo_, set_source_surface) EACH(cairo_, show_text) EACH(cairo_, status)                    \
  EACH(cairo_, status_to_string) EACH(cairo_, stroke) EACH(cairo_, stroke_preserve)                \
  EACH(cairo_, surface_destroy) EACH(cairo_, surface_finish) EACH(cairo_, surface_flush)           \
  EACH(cairo_, surface_mark_dirty) EACH(cairo_, svg_surface_create_for_stream)                     \
  EACH(cairo_, surface_status) EACH(cairo_, surface_write_to_png_stream)                           \
  EACH(cairo_, text_extents) EACH(cairo_, text_path) EACH(cairo_, translate)
/* clang-format on */

/* Functions of cairo. They are loaded at the first use, so that all commands that draw nothing run
 * without cairo and the X11 libraries that it needs. */
static struct { FUNCTIONS(SUPINE_LIBRARY_MEMBER) } cairo;

static const double pi = 3.14159265358979323846;

/* Colours of a picture's background, frames and letters. */
typedef struct theme {
  double ground[3];
  double card[3];
  double edge[3];
  double ink[3];
  double faint[3];
  double target[3]; /* of words about a target */
} theme;

/* The shell is bright at its rim, so it needs a dark ground. Colours of values are for paper. */
static const theme themes[2] = {[SUPINE_LOOK_MAP] = {.ground = {0.955, 0.965, 0.975},
                                                     .card = {1, 1, 1},
                                                     .edge = {0.86, 0.885, 0.91},
                                                     .ink = {0.09, 0.13, 0.18},
                                                     .faint = {0.37, 0.43, 0.49},
                                                     .target = {0.69, 0.24, 0.05}},
                                [SUPINE_LOOK_SHELL] = {.ground = {0.043, 0.071, 0.125},
                                                       .card = {0.043, 0.071, 0.125},
                                                       .edge = {0.043, 0.071, 0.125},
                                                       .ink = {0.96, 0.97, 1.0},
                                                       .faint = {0.63, 0.70, 0.80},
                                                       .target = {1.0, 0.69, 0.46}}};
static const double gravity_colour[3] = {0.91, 0.33, 0.17};

/* Layout of the picture, pixels. */
typedef struct layout {
  double font;
  double margin;
  double cell_width, cell_height;
  double heading_height;
  double footer_height; /* height of the area below the cells, which holds the colour bar */
} layout;

/* What draws a picture. */
typedef struct painter {
  cairo_t *cr;
  const supine_basis *basis;
  const supine_picture *picture;
  const theme *theme;
  double detail; /* pixels of the drawn lungs per unit of the picture: above 1 in vector files */
  layout at;
} painter;

static void colour(cairo_t *cr, const double rgb[3]) {
  cairo.set_source_rgb(cr, rgb[0], rgb[1], rgb[2]);
}

static void font(cairo_t *cr, double size, bool bold) {
  cairo.select_font_face(cr, "sans-serif", CAIRO_FONT_SLANT_NORMAL,
                         bold ? CAIRO_FONT_WEIGHT_BOLD : CAIRO_FONT_WEIGHT_NORMAL);
  cairo.set_font_size(cr, size);
}

static double text_width(cairo_t *cr, const char *text) {
  cairo_text_extents_t extents;
  cairo.text_extents(cr, text, &extents);
  return extents.x_advance;
}

/* Draw text with its left end (align 0), middle (0.5) or right end (1) at x, baseline at y. */
static void text(cairo_t *cr, double x, double y, double align, const char *words) {
  cairo.move_to(cr, x - align * text_width(cr, words), y);
  cairo.show_text(cr, words);
}

/* Draw text with its left end at x, reduced in size if it is wider than `room`, pixels. Return the
 * size. */
static double fitted_text(cairo_t *cr, double x, double y, double size, bool bold, double room,
                          const char *words) {
  font(cr, size, bold);
  const double fitted = size * fmin(1, room / text_width(cr, words));
  font(cr, fitted, bold);
  text(cr, x, y, 0, words);
  return fitted;
}

static void rounded(cairo_t *cr, double x, double y, double width, double height, double radius) {
  cairo.new_sub_path(cr);
  cairo.arc(cr, x + width - radius, y + radius, radius, -pi / 2, 0);
  cairo.arc(cr, x + width - radius, y + height - radius, radius, 0, pi / 2);
  cairo.arc(cr, x + radius, y + height - radius, radius, pi / 2, pi);
  cairo.arc(cr, x + radius, y + radius, radius, pi, 3 * pi / 2);
  cairo.close_path(cr);
}

/* Draw an arrow from `from` to `to`. Its head and its line have the sizes `head` and `line`. */
static void arrow(cairo_t *cr, const double from[2], const double to[2], double head, double line) {
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

/* Draw gravity on the ball that shows the body's axes: as a circle with a dot if it points nearly
 * towards the viewer, as a circle with a cross if it points nearly away, else as an arrow. `seen`
 * is gravity's unit vector in the viewer's axes. */
static void gravity_arrow(cairo_t *cr, double x, double y, double radius, const double seen[3]) {
  const double flat = hypot(seen[0], seen[1]);
  cairo.new_path(cr);
  colour(cr, gravity_colour);
  cairo.set_line_width(cr, radius * 0.13);
  if (flat < 0.35) {
    const double r = radius * 0.3;
    cairo.arc(cr, x, y, r, 0, 2 * pi);
    cairo.stroke(cr);
    if (seen[2] > 0) {
      cairo.arc(cr, x, y, r * 0.42, 0, 2 * pi);
      cairo.fill(cr);
      return;
    }
    const double d = r * 0.6;
    cairo.move_to(cr, x - d, y - d);
    cairo.line_to(cr, x + d, y + d);
    cairo.move_to(cr, x - d, y + d);
    cairo.line_to(cr, x + d, y - d);
    cairo.stroke(cr);
    return;
  }
  const double length = radius * fmax(flat, 0.55) / flat;
  const double from[2] = {x - 0.25 * length * seen[0], y + 0.25 * length * seen[1]};
  const double to[2] = {x + length * seen[0], y - length * seen[1]};
  arrow(cr, from, to, radius * 0.42, radius * 0.13);
}

/* Draw the ball that shows the body's axes and gravity. */
static void ball(const painter *by, double x, double y, double radius, supine_view view,
                 const double gravity[3]) {
  static const char *const ends[3][2] = {{"L", "R"}, {"P", "A"}, {"H", "F"}};
  cairo_t *cr = by->cr;
  const double *faint = by->theme->faint;
  const double *ink = by->theme->ink;
  double axes[3][3];
  double seen[3] = {0, 0, 0};
  supine_render_view_axes(view, gravity, axes);
  cairo.arc(cr, x, y, radius, 0, 2 * pi);
  cairo.set_source_rgba(cr, faint[0], faint[1], faint[2], 0.13);
  cairo.fill_preserve(cr);
  cairo.set_source_rgba(cr, faint[0], faint[1], faint[2], 0.5);
  cairo.set_line_width(cr, fmax(0.6, radius * 0.035));
  cairo.stroke(cr);
  font(cr, radius * 0.4, false);
  for (int axis = 0; axis < 3; ++axis) {
    const double dx = axes[0][axis];
    const double dy = -axes[1][axis];
    for (int row = 0; row < 3; ++row) {
      seen[row] += axes[row][axis] * gravity[axis];
    }
    if (hypot(dx, dy) < 0.3) {
      continue;
    }
    cairo.set_source_rgba(cr, faint[0], faint[1], faint[2], 0.45);
    cairo.move_to(cr, x - 0.62 * radius * dx, y - 0.62 * radius * dy);
    cairo.line_to(cr, x + 0.62 * radius * dx, y + 0.62 * radius * dy);
    cairo.stroke(cr);
    for (int end = 0; end < 2; ++end) {
      const double reach = (end == 0 ? 0.8 : -0.8) * radius;
      cairo.set_source_rgba(cr, ink[0], ink[1], ink[2], 0.8);
      text(cr, x + reach * dx, y + reach * dy + 0.145 * radius, 0.5, ends[axis][end]);
    }
  }
  gravity_arrow(cr, x, y, radius * 0.66, seen);
}

/* Move the name at index `count` down until it overlaps no earlier name. `box` holds the left end,
 * the baseline and the width of each name, and `line` is the height of a line, pixels. */
static void place_name(double (*box)[3], size_t count, double line) {
  double *own = box[count];
  for (size_t i = 0; i < count; ++i) {
    const bool beside = own[0] > box[i][0] + box[i][2] || box[i][0] > own[0] + own[2];
    if (!beside && fabs(own[1] - box[i][1]) < line * 0.999) {
      own[1] = box[i][1] + line;
      i = SIZE_MAX; /* the loop starts again with the first name */
    }
  }
}

/* Draw a label at `box`, which is as in place_name, and a line from it to its mark at `at`. */
static void name(const painter *by, const char *label, const double at[2], const double box[3],
                 double size) {
  cairo_t *cr = by->cr;
  const double *card = by->theme->card;
  const bool right = box[0] > at[0];
  colour(cr, by->theme->faint);
  cairo.set_line_width(cr, size * 0.06);
  cairo.move_to(cr, at[0] + (right ? 0.5 : -0.5) * size, at[1]);
  cairo.line_to(cr, box[0] + (right ? -0.2 * size : box[2] + 0.2 * size), box[1] - 0.25 * size);
  cairo.stroke(cr);
  cairo.move_to(cr, box[0], box[1]);
  cairo.text_path(cr, label);
  cairo.set_source_rgba(cr, card[0], card[1], card[2], 0.85);
  cairo.set_line_width(cr, size * 0.25);
  cairo.stroke_preserve(cr);
  colour(cr, by->theme->ink);
  cairo.fill(cr);
}

/* Draw labels on the outer side of their marks at `pixel`, so that lines to them do not cross. */
static void draw_names(const painter *by, const supine_marks *marks, double (*pixel)[2],
                       double (*box)[3], double width) {
  cairo_t *cr = by->cr;
  const double size = by->at.font;
  const double margin = 0.5 * size; /* part of that between the scene and the edge of its card */
  double sum = 0.0;
  size_t count = 0;
  for (size_t i = 0; i < marks->count; ++i) {
    sum += marks->mark[i].label != NULL ? pixel[i][0] : 0.0;
    count += marks->mark[i].label != NULL;
  }
  font(cr, size * 0.68, false);
  for (size_t i = 0, placed = 0; placed < count; ++i) {
    if (marks->mark[i].label != NULL) {
      double *own = box[placed];
      own[2] = text_width(cr, marks->mark[i].label);
      const double right = pixel[i][0] + 1.3 * size;
      const double left = pixel[i][0] - 1.3 * size - own[2];
      const bool outer_right = pixel[i][0] * (double)count >= sum * (1.0 - 1e-12);
      own[0] = right + own[2] < width + margin && (outer_right || left < -margin)
                   ? right
                   : fmax(-margin, left);
      own[1] = pixel[i][1] - size * 0.6;
      place_name(box, placed++, size);
      name(by, marks->mark[i].label, pixel[i], own, size);
    }
  }
}

/* Draw an arrow from the old place of each target to its place, then labels. Arrows are drawn over
 * the balls, with an edge in the colour of the ground, so that they are seen on any of them. The
 * origin is the upper left corner of the scene. */
static supine_status draw_marks(const painter *by, const supine_scene *scene,
                                const supine_marks *marks) {
  cairo_t *cr = by->cr;
  const double size = by->at.font;
  SUPINE_ARENA arena = {0};
  double(*pixel)[2] = supine_arena_take(&arena, marks->count, 2 * sizeof *pixel);
  double(*box)[3] = supine_arena_take(&arena, marks->count, sizeof *box);
  if (arena.failed) {
    return SUPINE_ERROR_MEMORY;
  }
  double(*from)[2] = pixel + marks->count;
  supine_render_project(by->basis, scene, marks, false, pixel);
  supine_render_project(by->basis, scene, marks, true, from);
  cairo.new_path(cr);
  for (size_t i = 0; i < marks->count; ++i) {
    const double moved = hypot(pixel[i][0] - from[i][0], pixel[i][1] - from[i][1]);
    if (marks->mark[i].label != NULL && moved > 0.25 * size) {
      const double head = fmin(size * 0.5, 0.6 * moved);
      colour(cr, by->theme->card);
      arrow(cr, from[i], pixel[i], 1.35 * head, size * 0.26);
      colour(cr, by->theme->ink);
      arrow(cr, from[i], pixel[i], head, size * 0.12);
    }
  }
  draw_names(by, marks, pixel, box, (double)scene->width);
  return SUPINE_OK;
}

static void free_surface(cairo_surface_t **surface) {
  cairo.surface_destroy(*surface);
}

/* Draw a scene on a new cairo surface, which the caller must destroy, even after a failure. */
static supine_status draw_scene(const supine_basis *basis, const supine_scene *scene,
                                cairo_surface_t **image, supine_error *error) {
  *image = cairo.image_surface_create(CAIRO_FORMAT_ARGB32, (int)scene->width, (int)scene->height);
  SUPINE_REFUSE_IF(cairo.surface_status(*image) != CAIRO_STATUS_SUCCESS ||
                       (size_t)cairo.image_surface_get_stride(*image) != 4 * scene->width,
                   error, SUPINE_ERROR_MEMORY, "out of memory");
  cairo.surface_flush(*image);
  const supine_status status = supine_render_draw(
      basis, scene, (uint32_t *)(void *)cairo.image_surface_get_data(*image), error);
  cairo.surface_mark_dirty(*image);
  return status;
}

/* Draw the lungs and the marks of a panel in a box {x, y, width, height}, pixels. */
static supine_status lungs(const painter *by, const supine_panel *panel, supine_view view,
                           const double box[4], const double extent[4], supine_error *error) {
  double shown[4] = {extent[0], extent[1], extent[2], extent[3]};
  double own[4] = SUPINE_EXTENT_NONE;
  supine_scene scene = {.pose = panel->pose,
                        .look = by->picture->look,
                        .value = panel->value,
                        .largest = by->picture->largest,
                        .colours = by->picture->colours,
                        .view = view,
                        .gravity = panel->gravity,
                        .content = panel->marks,
                        .width = (size_t)(by->detail * box[2]),
                        .height = (size_t)(by->detail * box[3]),
                        .extent = shown};
  if (view == SUPINE_VIEW_LYING) { /* put the lungs of every posture on the table */
    supine_render_extent(by->basis, &scene, own);
    shown[2] = own[2];
    shown[3] += own[2] - extent[2];
  }
  SUPINE_FREED_BY(free_surface) cairo_surface_t *image = NULL;
  SUPINE_TRY(draw_scene(by->basis, &scene, &image, error));
  cairo.save(by->cr);
  cairo.translate(by->cr, floor(box[0]), floor(box[1]));
  cairo.scale(by->cr, 1 / by->detail, 1 / by->detail);
  cairo.set_source_surface(by->cr, image, 0, 0);
  cairo.paint(by->cr);
  cairo.restore(by->cr);
  if (panel->marks != NULL) {
    scene.width = (size_t)box[2];
    scene.height = (size_t)box[3];
    cairo.translate(by->cr, floor(box[0]), floor(box[1]));
    SUPINE_TRY(draw_marks(by, &scene, panel->marks));
    cairo.translate(by->cr, -floor(box[0]), -floor(box[1]));
  }
  return SUPINE_OK;
}

/* Draw the cell of the picture that shows the posture `column` from the view `row`. */
static supine_status cell(const painter *by, size_t column, size_t row, const double extent[4],
                          supine_error *error) {
  cairo_t *cr = by->cr;
  const layout *at = &by->at;
  const supine_panel *panel = &by->picture->panel[column];
  const supine_view view = by->picture->view[row];
  const double gap = at->margin / 2;
  const double x = at->margin + (double)column * (at->cell_width + gap);
  const double y = at->margin + (double)row * (at->cell_height + gap);
  const double radius = at->heading_height * 0.4;
  const double words = x + 2 * radius + at->font * 1.5;
  const double room = x + at->cell_width - words - at->font;
  rounded(cr, x, y, at->cell_width, at->cell_height, at->font * 0.7);
  colour(cr, by->theme->card);
  cairo.fill_preserve(cr);
  colour(cr, by->theme->edge);
  cairo.set_line_width(cr, 1);
  cairo.stroke(cr);
  ball(by, x + radius + at->font * 0.7, y + at->heading_height / 2 + at->font * 0.2, radius, view,
       panel->gravity);
  colour(cr, by->theme->ink);
  (void)fitted_text(cr, words, y + at->heading_height / 2 - at->font * 0.25, at->font * 1.3, true,
                    room, panel->title);
  colour(cr, panel->about_target ? by->theme->target : by->theme->faint);
  const double size = fitted_text(cr, words, y + at->heading_height / 2 + at->font * 0.95,
                                  at->font * 0.82, false, room, panel->subtitle);
  colour(cr, by->theme->faint);
  (void)fitted_text(cr, words, y + at->heading_height / 2 + at->font * 2.0, size, false, room,
                    view == SUPINE_VIEW_LYING ? panel->note : supine_render_view_name(view));
  double below = at->font * 0.5; /* height of the space below the lungs */
  if (view == SUPINE_VIEW_LYING &&
      fabs(panel->gravity[2]) < SUPINE_VIEW_LYING_TILT) { /* the table */
    cairo.rectangle(cr, x + at->font, y + at->cell_height - 2 * at->font,
                    at->cell_width - 2 * at->font, at->font * 0.9);
    cairo.set_source_rgba(cr, by->theme->faint[0], by->theme->faint[1], by->theme->faint[2], 0.35);
    cairo.fill(cr);
    below = at->font * 3;
  }
  const double box[4] = {x + at->font * 0.5, y + at->heading_height, at->cell_width - at->font,
                         at->cell_height - at->heading_height - below};
  return lungs(by, panel, view, box, extent, error);
}

static void colour_bar(const painter *by) {
  enum { STOPS = 64 };
  cairo_t *cr = by->cr;
  const supine_picture *picture = by->picture;
  const layout *at = &by->at;
  const double step = supine_render_bar_step(picture->largest);
  const double width = fmin((double)picture->width - 2 * at->margin, 34 * at->font);
  const double x = ((double)picture->width - width) / 2;
  const double y = (double)picture->height - at->footer_height + at->font * 1.65;
  const double height = at->font * 0.8;
  cairo_pattern_t *fade = cairo.pattern_create_linear(x, 0, x + width, 0);
  for (int i = 0; i <= STOPS; ++i) {
    double rgb[3];
    supine_render_colour(picture->colours, i / (double)STOPS, rgb);
    cairo.pattern_add_color_stop_rgb(fade, i / (double)STOPS, rgb[0], rgb[1], rgb[2]);
  }
  cairo.rectangle(cr, x, y, width, height);
  if (picture->beyond) {
    cairo.move_to(cr, x + width, y);
    cairo.line_to(cr, x + width + 0.9 * height, y + height / 2);
    cairo.line_to(cr, x + width, y + height);
  }
  cairo.set_source(cr, fade);
  cairo.fill(cr);
  cairo.pattern_destroy(fade);
  font(cr, at->font * 0.85, false);
  colour(cr, by->theme->ink);
  text(cr, x + width / 2, y - at->font * 0.5, 0.5, picture->bar_label);
  colour(cr, by->theme->faint);
  cairo.set_line_width(cr, 1);
  for (int i = 0; i * step <= picture->largest * (1 + 1e-9); ++i) {
    char number[32];
    const double tick = x + width * i * step / picture->largest;
    (void)supine_print_text(number, sizeof number, "%g", i * step);
    cairo.move_to(cr, tick, y + height + at->font * 0.15);
    cairo.line_to(cr, tick, y + height + at->font * 0.4);
    cairo.stroke(cr);
    text(cr, tick, y + height + at->font * 1.3, 0.5, number);
  }
}

static layout make_layout(const supine_picture *picture) {
  layout at;
  const double width = (double)picture->width;
  const double height = (double)picture->height;
  at.font =
      fmin(width / (double)picture->panel_count / 19, height / (double)picture->view_count / 24);
  at.font = fmin(28, at.font);
  at.margin = at.font * 0.9;
  at.heading_height = at.font * 5.2;
  at.footer_height = picture->look == SUPINE_LOOK_MAP ? at.font * 4.6 : at.margin;
  const double gap = at.margin / 2;
  at.cell_width = (width - 2 * at.margin - gap * (double)(picture->panel_count - 1)) /
                  (double)picture->panel_count;
  at.cell_height =
      (height - at.margin - at.footer_height - gap * (double)(picture->view_count - 1)) /
      (double)picture->view_count;
  return at;
}

void supine_render_picture_extent(const supine_basis *basis, const supine_picture *picture,
                                  double (*extent)[4]) {
  for (size_t row = 0; row < picture->view_count; ++row) {
    for (size_t column = 0; column < picture->panel_count; ++column) {
      const supine_scene scene = {.pose = picture->panel[column].pose,
                                  .view = picture->view[row],
                                  .gravity = picture->panel[column].gravity};
      supine_render_extent(basis, &scene, extent[row]);
    }
  }
}

static supine_status compose(const painter *by, supine_error *error) {
  static const double none[4] = SUPINE_EXTENT_NONE;
  const supine_picture *picture = by->picture;
  double extent[SUPINE_VIEWS_MAX][4];
  SUPINE_REFUSE_IF(
      by->at.font < 4, error, SUPINE_ERROR_ARGUMENT,
      "%zu x %zu pixels are too few for %zu posture%s and %zu view%s: give a larger --size",
      picture->width, picture->height, picture->panel_count, picture->panel_count == 1 ? "" : "s",
      picture->view_count, picture->view_count == 1 ? "" : "s");
  colour(by->cr, by->theme->ground);
  cairo.paint(by->cr);
  for (size_t row = 0; row < picture->view_count; ++row) {
    memcpy(extent[row], picture->extent != NULL ? picture->extent[row] : none, sizeof none);
  }
  if (picture->extent == NULL) {
    supine_render_picture_extent(by->basis, picture, extent);
  }
  for (size_t i = 0; i < picture->view_count * picture->panel_count; ++i) {
    const size_t row = i / picture->panel_count;
    SUPINE_TRY(cell(by, i % picture->panel_count, row, extent[row], error));
  }
  if (picture->look == SUPINE_LOOK_MAP) {
    colour_bar(by);
  }
  return SUPINE_OK;
}

static cairo_status_t to_file(void *file, const unsigned char *bytes, unsigned length) {
  return fwrite(bytes, 1, length, file) == length ? CAIRO_STATUS_SUCCESS : CAIRO_STATUS_WRITE_ERROR;
}

/* Refuse what cairo could not draw or write. `what` names the picture or the format. */
static supine_status check(cairo_status_t drawn, const char *what, supine_error *error) {
  SUPINE_REFUSE_IF(drawn == CAIRO_STATUS_NO_MEMORY, error, SUPINE_ERROR_MEMORY, "out of memory");
  SUPINE_REFUSE_IF(drawn != CAIRO_STATUS_SUCCESS, error, SUPINE_ERROR_WRITE, "%s: cairo: %s", what,
                   cairo.status_to_string(drawn));
  return SUPINE_OK;
}

static supine_status write_png(cairo_surface_t *surface, FILE *file, supine_error *error) {
  return check(cairo.surface_write_to_png_stream(surface, to_file, file), "PNG", error);
}

static void free_context(cairo_t **cr) {
  cairo.destroy(*cr);
}

/* Compose a picture on a surface. After an error, such as text that is not UTF-8, cairo draws
 * nothing more: so its status is checked at the end. */
static supine_status draw_on(cairo_surface_t *surface, double detail, const supine_basis *basis,
                             const supine_picture *picture, supine_error *error) {
  SUPINE_FREED_BY(free_context) cairo_t *cr = cairo.create(surface);
  const painter by = {
      cr, basis, picture, &themes[picture->look], detail, make_layout(picture),
  };
  SUPINE_TRY(check(cairo.status(cr), "picture", error));
  SUPINE_TRY(compose(&by, error));
  cairo.surface_flush(surface);
  return check(cairo.status(cr), "picture", error);
}

supine_status supine_render_picture_draw(const supine_basis *basis, const supine_picture *picture,
                                         uint32_t *pixels, supine_error *error) {
  SUPINE_TRY(SUPINE_LIBRARY_LOAD(SUPINE_CAIRO, FUNCTIONS, &cairo, error));
  SUPINE_FREED_BY(free_surface)
  cairo_surface_t *surface = cairo.image_surface_create_for_data(
      (unsigned char *)pixels, CAIRO_FORMAT_RGB24, (int)picture->width, (int)picture->height,
      (int)(4 * picture->width));
  return draw_on(surface, 1.0, basis, picture, error);
}

/* Draw a picture on a surface whose bytes go to a file: PDF or SVG. */
static supine_status write_vector(cairo_surface_t *surface, const supine_basis *basis,
                                  const supine_picture *picture, supine_error *error) {
  static const double detail = 3.0; /* pixels of the lungs per unit, 1/72 inch */
  SUPINE_TRY(draw_on(surface, detail, basis, picture, error));
  cairo.surface_finish(surface);
  return check(cairo.surface_status(surface), "picture", error);
}

static supine_status write_picture(const char *path, FILE *file, const supine_basis *basis,
                                   const supine_picture *picture, supine_error *error) {
  const double width = (double)picture->width;
  const double height = (double)picture->height;
  SUPINE_FREED_BY(free_surface) cairo_surface_t *surface = NULL;
  if (supine_text_ends_in(path, ".pdf")) {
    surface = cairo.pdf_surface_create_for_stream(to_file, file, width, height);
    /* No date: the same picture has the same bytes. */
    cairo.pdf_surface_set_metadata(surface, CAIRO_PDF_METADATA_CREATE_DATE, "");
    return write_vector(surface, basis, picture, error);
  }
  if (supine_text_ends_in(path, ".svg")) {
    surface = cairo.svg_surface_create_for_stream(to_file, file, width, height);
    return write_vector(surface, basis, picture, error);
  }
  surface = cairo.image_surface_create(CAIRO_FORMAT_RGB24, (int)width, (int)height);
  SUPINE_TRY(draw_on(surface, 1.0, basis, picture, error));
  return write_png(surface, file, error);
}

supine_status supine_render_picture_save(const supine_basis *basis, const supine_picture *picture,
                                         const char *path, supine_error *error) {
  SUPINE_FREED_BY(supine_output_abandon) supine_output output = {0};
  SUPINE_TRY(SUPINE_LIBRARY_LOAD(SUPINE_CAIRO, FUNCTIONS, &cairo, error));
  SUPINE_TRY(supine_output_open(path, &output, error));
  const supine_status status = write_picture(path, output.file, basis, picture, error);
  return status == SUPINE_OK || ferror(output.file) != 0 ? supine_output_commit(&output, error)
                                                         : status;
}

supine_status supine_render_png(const supine_basis *basis, const supine_scene *scene, FILE *file,
                                supine_error *error) {
  SUPINE_TRY(SUPINE_LIBRARY_LOAD(SUPINE_CAIRO, FUNCTIONS, &cairo, error));
  SUPINE_FREED_BY(free_surface) cairo_surface_t *image = NULL;
  SUPINE_TRY(draw_scene(basis, scene, &image, error));
  return write_png(image, file, error);
}
