/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Draw names, rings and arrows of the structures inside the lungs over a picture. */
#ifndef SUPINE_RENDER_MARKS_H
#define SUPINE_RENDER_MARKS_H

#include "program/view/render/letters.h"
#include "program/view/render/render.h"

/* Colours and sizes of what is drawn over the lungs. */
typedef struct marks_style {
  const double *ground; /* [3] colour of the background, which surrounds letters and arrows */
  const double *ink;    /* [3] of letters and arrows */
  const double *faint;  /* [3] of the lines from names to their marks */
  const double *target; /* [3] of the ring around the selected target */
  double font;          /* size of the picture's letters, pixels */
  double heading[2];    /* width and height of the upper left corner that words fill, pixels */
} marks_style;

/* Load cairo. Call this before the other functions. */
supine_status supine_render_marks_load(supine_error *error);

/* Draw the marks that have a label: a ring of the expected error and a dashed circle where it was
 * for the selected target, an arrow for each that moved, and all names. The origin is the upper
 * left corner of the scene. */
supine_status supine_render_marks_draw(cairo_t *cr, const marks_style *style,
                                       const supine_basis *basis, const supine_scene *scene);

/* Draw an arrow from `from` to `to`. Its head and its line have the sizes `head` and `line`. */
void supine_render_arrow(cairo_t *cr, const double from[2], const double to[2], double head,
                         double line);

#endif
