/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Set text with pango or, without it, with cairo. */
#include "program/view/render/letters.h"

#include <pango/pangocairo.h>

#include "base/arena.h"
#include "base/library.h"
#include "program/view/render/render.h"

#define CAIRO_FUNCTIONS(EACH)                                                                      \
  EACH(cairo_, move_to)                                                                            \
  EACH(cairo_, select_font_face)                                                                   \
  EACH(cairo_, set_font_size)                                                                      \
  EACH(cairo_, show_text) EACH(cairo_, text_extents) EACH(cairo_, text_path)

#define PANGO_FUNCTIONS(EACH)                                                                      \
  EACH(pango_, context_set_base_dir)                                                               \
  EACH(pango_, font_description_free)                                                              \
  EACH(pango_, font_description_new)                                                               \
  EACH(pango_, font_description_set_absolute_size)                                                 \
  EACH(pango_, font_description_set_family)                                                        \
  EACH(pango_, font_description_set_weight)                                                        \
  EACH(pango_, layout_get_baseline)                                                                \
  EACH(pango_, layout_get_context)                                                                 \
  EACH(pango_, layout_get_size)                                                                    \
  EACH(pango_, layout_set_auto_dir)                                                                \
  EACH(pango_, layout_set_font_description) EACH(pango_, layout_set_text)

#define PANGOCAIRO_FUNCTIONS(EACH)                                                                 \
  EACH(pango_cairo_, create_layout)                                                                \
  EACH(pango_cairo_, layout_path) EACH(pango_cairo_, show_layout)

#define OBJECT_FUNCTIONS(EACH) EACH(g_object_, unref)

static struct { CAIRO_FUNCTIONS(SUPINE_LIBRARY_MEMBER) } cairo;
static struct { PANGO_FUNCTIONS(SUPINE_LIBRARY_MEMBER) } pango;
static struct { PANGOCAIRO_FUNCTIONS(SUPINE_LIBRARY_MEMBER) } pangocairo;
static struct { OBJECT_FUNCTIONS(SUPINE_LIBRARY_MEMBER) } object;

supine_status supine_render_letters_load(supine_error *error) {
  SUPINE_TRY(SUPINE_LIBRARY_LOAD(SUPINE_CAIRO, CAIRO_FUNCTIONS, &cairo, error));
  (void)supine_render_shapes_text();
  return SUPINE_OK;
}

bool supine_render_shapes_text(void) {
  return SUPINE_LIBRARY_LOAD(SUPINE_PANGO, PANGO_FUNCTIONS, &pango, NULL) == SUPINE_OK &&
         SUPINE_LIBRARY_LOAD(SUPINE_PANGOCAIRO, PANGOCAIRO_FUNCTIONS, &pangocairo, NULL) ==
             SUPINE_OK &&
         SUPINE_LIBRARY_LOAD(SUPINE_GOBJECT, OBJECT_FUNCTIONS, &object, NULL) == SUPINE_OK;
}

/* Return a layout of one line of text, which the caller frees; NULL without pango. */
static PangoLayout *layout_of(cairo_t *cr, const letters *face, const char *words) {
  if (object.unref == NULL) {
    return NULL;
  }
  PangoLayout *line = pangocairo.create_layout(cr);
  PangoFontDescription *font = pango.font_description_new();
  pango.font_description_set_family(font, "sans-serif");
  pango.font_description_set_weight(font, face->bold ? PANGO_WEIGHT_BOLD : PANGO_WEIGHT_NORMAL);
  pango.font_description_set_absolute_size(font, face->size * PANGO_SCALE);
  pango.layout_set_font_description(line, font);
  pango.font_description_free(font);
  /* Captions are English: a name from right to left does not turn the number after it. */
  pango.context_set_base_dir(pango.layout_get_context(line), PANGO_DIRECTION_LTR);
  pango.layout_set_auto_dir(line, FALSE);
  pango.layout_set_text(line, words, -1);
  return line;
}

/* Select the face for cairo's own text. */
static void select_face(cairo_t *cr, const letters *face) {
  cairo.select_font_face(cr, "sans-serif", CAIRO_FONT_SLANT_NORMAL,
                         face->bold ? CAIRO_FONT_WEIGHT_BOLD : CAIRO_FONT_WEIGHT_NORMAL);
  cairo.set_font_size(cr, face->size);
}

double supine_render_letters_width(cairo_t *cr, const letters *face, const char *words) {
  PangoLayout *line = layout_of(cr, face, words);
  if (line == NULL) {
    cairo_text_extents_t extents;
    select_face(cr, face);
    cairo.text_extents(cr, words, &extents);
    return extents.x_advance;
  }
  int width = 0;
  pango.layout_get_size(line, &width, NULL);
  object.unref(line);
  return (double)width / PANGO_SCALE;
}

/* Show a line of text, or append its outline to the current path. */
static void put(cairo_t *cr, const letters *face, double x, double y, const char *words,
                bool shown) {
  PangoLayout *line = layout_of(cr, face, words);
  if (line == NULL) {
    select_face(cr, face);
    cairo.move_to(cr, x, y);
    (shown ? cairo.show_text : cairo.text_path)(cr, words);
    return;
  }
  cairo.move_to(cr, x, y - (double)pango.layout_get_baseline(line) / PANGO_SCALE);
  (shown ? pangocairo.show_layout : pangocairo.layout_path)(cr, line);
  object.unref(line);
}

void supine_render_letters_show(cairo_t *cr, const letters *face, double x, double y,
                                const char *words) {
  put(cr, face, x, y, words, true);
}

void supine_render_letters_path(cairo_t *cr, const letters *face, double x, double y,
                                const char *words) {
  put(cr, face, x, y, words, false);
}
