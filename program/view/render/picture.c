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
#include "program/view/render/canvas.h"
#include "program/view/render/letters.h"
#include "program/view/render/marks.h"

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
  EACH(cairo_, set_line_width)          \
  EACH(cairo_, set_source) EACH(cairo_, set_source_rgb) EACH(cairo_, set_source_rgba)              \
  EACH(cairo_, set_source_surface) EACH(cairo_, status)                    \
  EACH(cairo_, status_to_string) EACH(cairo_, stroke)                \
  EACH(cairo_, surface_destroy) EACH(cairo_, surface_finish) EACH(cairo_, surface_flush)           \
  EACH(cairo_, surface_mark_dirty) EACH(cairo_, svg_surface_create_for_stream)                     \
  EACH(cairo_, surface_status) EACH(cairo_, surface_write_to_png_stream)                           \
  EACH(cairo_, translate)
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
  double footer_height;  /* height of the area below the cells, which holds the colour bar */
  double caption_height; /* height of the lowest part of the footer, which holds the caption */
  letters small;         /* of the footer's words and the caption */
  double step;           /* distance of their lines */
  double room;           /* width of the lines */
  bool beside;           /* whether the remark is beside the legend, and not below it */
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

static supine_status load(supine_error *error) {
  SUPINE_TRY(supine_render_marks_load(error));
  return SUPINE_LIBRARY_LOAD(SUPINE_CAIRO, FUNCTIONS, &cairo, error);
}

static void colour(cairo_t *cr, const double rgb[3]) {
  cairo.set_source_rgb(cr, rgb[0], rgb[1], rgb[2]);
}

/* Draw text with its left end (align 0), middle (0.5) or right end (1) at x, baseline at y. */
static void text(cairo_t *cr, const letters *face, double x, double y, double align,
                 const char *words) {
  if (align > 0.0) {
    x -= align * supine_render_letters_width(cr, face, words);
  }
  supine_render_letters_show(cr, face, x, y, words);
}

/* Draw text with its left end at x, reduced in size if it is wider than `room`, pixels. Return its
 * width. */
static double fitted_text(cairo_t *cr, double x, double y, const letters *face, double room,
                          const char *words) {
  letters fitted = *face;
  const double width = supine_render_letters_width(cr, face, words);
  fitted.size *= fmin(1.0, room / width);
  text(cr, &fitted, x, y, 0.0, words);
  return fmin(width, room);
}

enum { LINE_SIZE = 512 };

/* Copy the words of the next line of a text, broken at a blank, to `line`. Return the rest of the
 * text. */
static const char *next_line(cairo_t *cr, const letters *face, double room, const char *words,
                             char line[LINE_SIZE]) {
  size_t fits = 0;
  for (size_t length = 1; length + 1 < LINE_SIZE && words[length - 1] != '\0'; ++length) {
    if (words[length] == ' ' || words[length] == '\0') {
      (void)snprintf(line, LINE_SIZE, "%.*s", (int)length, words);
      if (fits > 0 && supine_render_letters_width(cr, face, line) > room) {
        break;
      }
      fits = length;
    }
  }
  (void)snprintf(line, LINE_SIZE, "%.*s", (int)fits, words);
  return words + fits + (words[fits] == ' ');
}

static size_t count_lines(cairo_t *cr, const letters *face, double room, const char *words) {
  size_t count = 0;
  for (char line[LINE_SIZE]; words != NULL && *words != '\0'; ++count) {
    words = next_line(cr, face, room, words, line);
  }
  return count;
}

/* Draw a text in lines of `room` pixels, `step` apart, from the baseline y on. */
static void paragraph(cairo_t *cr, const letters *face, double x, double y, double room,
                      double step, const char *words) {
  for (char line[LINE_SIZE]; *words != '\0'; y += step) {
    words = next_line(cr, face, room, words, line);
    (void)fitted_text(cr, x, y, face, room, line);
  }
}

static void rounded(cairo_t *cr, double x, double y, double width, double height, double radius) {
  cairo.new_sub_path(cr);
  cairo.arc(cr, x + width - radius, y + radius, radius, -pi / 2, 0);
  cairo.arc(cr, x + width - radius, y + height - radius, radius, 0, pi / 2);
  cairo.arc(cr, x + radius, y + height - radius, radius, pi / 2, pi);
  cairo.arc(cr, x + radius, y + radius, radius, pi, 3 * pi / 2);
  cairo.close_path(cr);
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
  supine_render_arrow(cr, from, to, radius * 0.42, radius * 0.13);
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
  const letters face = {radius * 0.4, false};
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
      text(cr, &face, x + reach * dx, y + reach * dy + 0.145 * radius, 0.5, ends[axis][end]);
    }
  }
  gravity_arrow(cr, x, y, radius * 0.66, seen);
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

/* Return the height of the table on which the patient of a panel lies, in the plane of
 * supine_render_extent, mm: below the lowest point of the lungs by the thickness of the chest's
 * wall where the torso is drawn. */
static double ground_of(const supine_picture *picture, const double own[4]) {
  static const double wall = 28.0; /* mm */
  return picture->look == SUPINE_LOOK_SHELL ? own[2] - wall : own[2];
}

/* Return how far below the upper edge of a box {x, y, width, height} the height `ground`, mm, is
 * drawn with an extent, as a share of the box's height (supine_render_camera_aim). */
static double share_above(const double extent[4], const double box[4], double ground) {
  const double wide = 1.03 * (extent[1] - extent[0]) / 2;
  const double high = 1.03 * (extent[3] - extent[2]) / 2;
  const double half = fmax(fmax(high, wide * box[3] / box[2]), 1e-3);
  return 0.5 * (1.0 - (ground - (extent[2] + extent[3]) / 2) / half);
}

/* Draw the table at height `at`, pixels from the upper edge of a box {x, y, width, height}. */
static void table(const painter *by, const double box[4], double at) {
  const double *ground = by->theme->ground;
  const double *faint = by->theme->faint;
  const double share = by->picture->look == SUPINE_LOOK_SHELL ? 0.2 : 0.35; /* of `faint` */
  cairo.rectangle(by->cr, box[0], box[1] + at, box[2], box[3] - at);
  cairo.set_source_rgb(by->cr, ground[0] + share * (faint[0] - ground[0]),
                       ground[1] + share * (faint[1] - ground[1]),
                       ground[2] + share * (faint[2] - ground[2]));
  cairo.fill(by->cr);
}

/* Draw the lungs and the marks of a panel in a box {x, y, width, height}, pixels. */
static supine_status lungs(const painter *by, const supine_panel *panel, supine_view view,
                           const double box[4], const double extent[4], supine_error *error) {
  double shown[4] = {extent[0], extent[1], extent[2], extent[3]};
  double own[4] = SUPINE_EXTENT_NONE;
  double table_at = 1.0; /* share of the box's height above the table */
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
  if (view == SUPINE_VIEW_LYING) { /* put the patient in every posture on the table */
    supine_render_extent(by->basis, &scene, own);
    const double ground = ground_of(by->picture, own);
    shown[2] += ground;
    shown[3] += ground;
    table_at = share_above(shown, box, ground);
  }
  SUPINE_FREED_BY(free_surface) cairo_surface_t *image = NULL;
  SUPINE_TRY(draw_scene(by->basis, &scene, &image, error));
  cairo.save(by->cr);
  cairo.translate(by->cr, floor(box[0]), floor(box[1]));
  cairo.scale(by->cr, 1 / by->detail, 1 / by->detail);
  cairo.set_source_surface(by->cr, image, 0, 0);
  cairo.paint(by->cr);
  cairo.restore(by->cr);
  if (table_at < 1.0 && fabs(panel->gravity[2]) < SUPINE_VIEW_LYING_TILT) {
    table(by, box, box[3] * table_at);
  }
  if (panel->marks != NULL) {
    const layout *at = &by->at;
    const bool beside =
        box[3] > at->cell_height - at->heading_height; /* the heading is in the box */
    const marks_style style = {.ground = by->theme->card,
                               .ink = by->theme->ink,
                               .faint = by->theme->faint,
                               .target = by->theme->target,
                               .font = at->font,
                               .heading = {beside ? box[2] / 2 : 0.0, at->heading_height}};
    scene.width = (size_t)box[2];
    scene.height = (size_t)box[3];
    cairo.translate(by->cr, floor(box[0]), floor(box[1]));
    SUPINE_TRY(supine_render_marks_draw(by->cr, &style, by->basis, &scene));
    cairo.translate(by->cr, -floor(box[0]), -floor(box[1]));
  }
  return SUPINE_OK;
}

/* Draw the three lines above the lungs of a panel, from x, y on, within `room`, pixels. */
static void heading(const painter *by, const supine_panel *panel, supine_view view, double x,
                    double y, double room) {
  cairo_t *cr = by->cr;
  const double size = by->at.font;
  const letters title = {1.3 * size, true};
  const letters figure = {0.85 * size, true};
  const letters plain = {0.82 * size, false};
  const letters small = {0.68 * size, false};
  double used = 0.0;
  colour(cr, by->theme->ink);
  (void)fitted_text(cr, x, y + 1.3 * size, &title, room, panel->title);
  if (panel->figure != NULL) {
    colour(cr, by->theme->target);
    used = fitted_text(cr, x, y + 2.5 * size, &figure, 0.5 * room, panel->figure) + 0.3 * size;
  }
  colour(cr, by->theme->faint);
  (void)fitted_text(cr, x + used, y + 2.5 * size, &plain, room - used, panel->subtitle);
  (void)fitted_text(cr, x, y + 3.5 * size, &small, room,
                    view == SUPINE_VIEW_LYING ? panel->note : supine_render_view_name(view));
}

/* Draw the background of the cell that shows values: a card. */
static void card(const painter *by, double x, double y) {
  const layout *at = &by->at;
  rounded(by->cr, x, y, at->cell_width, at->cell_height, at->font * 0.7);
  colour(by->cr, by->theme->card);
  cairo.fill_preserve(by->cr);
  colour(by->cr, by->theme->edge);
  cairo.set_line_width(by->cr, 1);
  cairo.stroke(by->cr);
}

/* Widen an extent on its left, so that the lungs are right of the middle of a box {x, y, width,
 * height} by an eighth of its width, if they fit there at the same scale. */
static void move_aside(const double box[4], double extent[4]) {
  const double width = (extent[3] - extent[2]) * box[2] / box[3]; /* of the box, mm */
  const double free = fmax(0.0, width - (extent[1] - extent[0]));
  extent[0] -= fmin(free, 2.0 / 8.0 * width);
}

/* Draw the cell of the picture that shows the posture `column` from the view `row`. Shells touch
 * each other, and gravity points down in them if they are seen as the patient lies; in cells that
 * are wide enough, the lungs are beside the heading. Values have cards, with a ball that shows
 * gravity. */
static supine_status cell(const painter *by, size_t column, size_t row, const double extent[4],
                          supine_error *error) {
  const layout *at = &by->at;
  const supine_panel *panel = &by->picture->panel[column];
  const supine_view view = by->picture->view[row];
  const bool shell = by->picture->look == SUPINE_LOOK_SHELL;
  const double edge = shell ? 0.0 : at->margin;
  const double gap = shell ? 0.0 : at->margin / 2;
  const double x = edge + (double)column * (at->cell_width + gap);
  const double y = edge + (double)row * (at->cell_height + gap);
  const double radius = at->heading_height * 0.4;
  const bool ball_shown = !shell || view != SUPINE_VIEW_LYING;
  const double words = x + at->font + (ball_shown ? 2 * radius + 0.5 * at->font : 0.0);
  const double high = at->cell_height - 0.5 * at->font;
  const double across = high * (extent[1] - extent[0]) / (extent[3] - extent[2]); /* of the lungs */
  const bool wide = shell && across < 0.6 * at->cell_width;
  const double room = x + (wide ? 0.5 : 1.0) * at->cell_width - words - 0.5 * at->font;
  const double side = shell ? 0.0 : 0.5 * at->font; /* space beside and below the lungs */
  const double above = wide ? at->cell_height - high : at->heading_height;
  const double box[4] = {x + side, y + above, at->cell_width - 2 * side,
                         at->cell_height - above - side};
  double shown[4] = {extent[0], extent[1], extent[2], extent[3]};
  if (!shell) {
    card(by, x, y);
  }
  if (wide) {
    move_aside(box, shown);
  }
  SUPINE_TRY(lungs(by, panel, view, box, shown, error));
  if (ball_shown) {
    ball(by, x + radius + at->font * 0.7, y + at->heading_height / 2 + at->font * 0.2, radius, view,
         panel->gravity);
  }
  heading(by, panel, view, words, y + at->font * 0.3, room);
  return SUPINE_OK;
}

/* Write what the signs of a shell mean, and a remark, below the cells. */
static void footer(const painter *by) {
  const supine_picture *picture = by->picture;
  const layout *at = &by->at;
  const double right = (double)picture->width - at->margin;
  double y = (double)picture->height - at->caption_height - at->footer_height + 0.9 * at->font;
  colour(by->cr, by->theme->faint);
  if (picture->legend != NULL) {
    paragraph(by->cr, &at->small, at->margin, y, at->room, at->step, picture->legend);
    y += at->beside ? 0.0
                    : at->step * (double)count_lines(by->cr, &at->small, at->room, picture->legend);
  }
  if (picture->remark != NULL) {
    text(by->cr, &at->small, at->beside ? right : at->margin, y, at->beside ? 1.0 : 0.0,
         picture->remark);
  }
}

static void caption(const painter *by) {
  const layout *at = &by->at;
  const double y = (double)by->picture->height - at->caption_height + 0.3 * at->font + at->step;
  colour(by->cr, by->theme->faint);
  paragraph(by->cr, &at->small, at->margin, y, at->room, at->step, by->picture->caption);
}

static void colour_bar(const painter *by) {
  enum { STOPS = 64 };
  cairo_t *cr = by->cr;
  const supine_picture *picture = by->picture;
  const layout *at = &by->at;
  const double step = supine_render_bar_step(picture->largest);
  const double width = fmin((double)picture->width - 2 * at->margin, 34 * at->font);
  const double x = ((double)picture->width - width) / 2;
  const double y =
      (double)picture->height - at->caption_height - at->footer_height + at->font * 1.65;
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
  const letters face = {at->font * 0.85, false};
  colour(cr, by->theme->ink);
  text(cr, &face, x + width / 2, y - at->font * 0.5, 0.5, picture->bar_label);
  colour(cr, by->theme->faint);
  cairo.set_line_width(cr, 1);
  for (int i = 0; i * step <= picture->largest * (1 + 1e-9); ++i) {
    char number[32];
    const double tick = x + width * i * step / picture->largest;
    (void)supine_print_text(number, sizeof number, "%g", i * step);
    cairo.move_to(cr, tick, y + height + at->font * 0.15);
    cairo.line_to(cr, tick, y + height + at->font * 0.4);
    cairo.stroke(cr);
    text(cr, &face, tick, y + height + at->font * 1.3, 0.5, number);
  }
}

/* Plan the words below the cells, in letters of at least `least` pixels. */
static void plan_words(cairo_t *cr, const supine_picture *picture, double least, layout *at) {
  at->small = (letters){fmax(least, 0.6 * at->font), false};
  at->step = 1.25 * at->small.size;
  const size_t lines[2] = {count_lines(cr, &at->small, at->room, picture->legend),
                           count_lines(cr, &at->small, at->room, picture->caption)};
  double used = at->font;
  used +=
      picture->legend != NULL ? supine_render_letters_width(cr, &at->small, picture->legend) : 0;
  used +=
      picture->remark != NULL ? supine_render_letters_width(cr, &at->small, picture->remark) : 0;
  at->beside = used <= at->room;
  at->caption_height = lines[1] > 0 ? at->step * (double)lines[1] + 0.7 * at->font : 0.0;
  at->footer_height = 4.6 * at->font; /* of a colour bar */
  if (picture->look == SUPINE_LOOK_SHELL) {
    const size_t more = at->beside ? 0 : lines[0];
    at->footer_height = 0.85 * at->font + at->step * (double)(more + 1);
  }
}

static layout make_layout(cairo_t *cr, const supine_picture *picture) {
  layout at;
  const double width = (double)picture->width;
  const double height = (double)picture->height;
  const double columns = (double)picture->panel_count;
  const double rows = (double)picture->view_count;
  at.font = fmin(28, fmin(width / columns / 19, height / rows / 24));
  at.margin = at.font * 0.9;
  at.room = width - 2 * at.margin;
  plan_words(cr, picture, 10.0, &at);
  if (at.caption_height + at.footer_height > height / 3) {
    plan_words(cr, picture, 0.0, &at);
  }
  if (picture->look == SUPINE_LOOK_SHELL) {
    at.heading_height = at.font * 4.1;
    at.cell_width = floor(width / columns);
    at.cell_height = (height - at.footer_height - at.caption_height) / rows;
    return at;
  }
  const double gap = at.margin / 2;
  at.heading_height = at.font * 5.2;
  at.cell_width = (width - 2 * at.margin - gap * (columns - 1)) / columns;
  at.cell_height =
      (height - at.margin - at.footer_height - at.caption_height - gap * (rows - 1)) / rows;
  return at;
}

void supine_render_picture_extent(const supine_basis *basis, const supine_picture *picture,
                                  double (*extent)[4]) {
  for (size_t row = 0; row < picture->view_count; ++row) {
    for (size_t column = 0; column < picture->panel_count; ++column) {
      const supine_panel *panel = &picture->panel[column];
      const supine_scene scene = {
          .pose = panel->pose, .view = picture->view[row], .gravity = panel->gravity};
      double own[4] = SUPINE_EXTENT_NONE;
      supine_render_extent(basis, &scene, own);
      const double ground = picture->view[row] == SUPINE_VIEW_LYING ? ground_of(picture, own) : 0.0;
      if (picture->look == SUPINE_LOOK_SHELL && picture->view[row] == SUPINE_VIEW_LYING) {
        own[2] = fmin(own[2], ground - 10.0); /* show the table, too */
      }
      for (size_t side = 0; side < 4; side += 2) {
        const double shift = side == 2 ? ground : 0.0;
        extent[row][side] = fmin(extent[row][side], own[side] - shift);
        extent[row][side + 1] = fmax(extent[row][side + 1], own[side + 1] - shift);
      }
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
  } else {
    footer(by);
  }
  if (by->at.caption_height > 0.0) {
    caption(by);
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
      cr, basis, picture, &themes[picture->look], detail, make_layout(cr, picture),
  };
  SUPINE_TRY(check(cairo.status(cr), "picture", error));
  SUPINE_TRY(compose(&by, error));
  cairo.surface_flush(surface);
  return check(cairo.status(cr), "picture", error);
}

supine_status supine_render_picture_draw(const supine_basis *basis, const supine_picture *picture,
                                         uint32_t *pixels, supine_error *error) {
  SUPINE_TRY(load(error));
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
  SUPINE_TRY(load(error));
  SUPINE_TRY(supine_output_open(path, &output, error));
  const supine_status status = write_picture(path, output.file, basis, picture, error);
  return status == SUPINE_OK || ferror(output.file) != 0 ? supine_output_commit(&output, error)
                                                         : status;
}

supine_status supine_render_png(const supine_basis *basis, const supine_scene *scene, FILE *file,
                                supine_error *error) {
  SUPINE_TRY(load(error));
  SUPINE_FREED_BY(free_surface) cairo_surface_t *image = NULL;
  SUPINE_TRY(draw_scene(basis, scene, &image, error));
  return write_png(image, file, error);
}
