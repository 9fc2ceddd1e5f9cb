/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Set text with pango, which shapes Arabic, Hebrew and other scripts, or with cairo's own simple
 * text where pango is not installed. */
#ifndef SUPINE_RENDER_LETTERS_H
#define SUPINE_RENDER_LETTERS_H

#include <stdbool.h>

#include <cairo.h>

#include <supine/status.h>

/* A face of the sans-serif font. */
typedef struct letters {
  double size; /* pixels */
  bool bold;
} letters;

/* Load cairo and, where it is installed, pango. Call this before the other functions. */
supine_status supine_render_letters_load(supine_error *error);

/* Return the width of a line of text, pixels. */
double supine_render_letters_width(cairo_t *cr, const letters *face, const char *words);

/* Draw a line of text in the current colour, with its left end at x and its baseline at y. */
void supine_render_letters_show(cairo_t *cr, const letters *face, double x, double y,
                                const char *words);

/* Append the outline of the same text to the current path. */
void supine_render_letters_path(cairo_t *cr, const letters *face, double x, double y,
                                const char *words);

#endif
