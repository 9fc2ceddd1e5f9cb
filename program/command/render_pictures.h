/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Draw the lungs in several postures as a picture, or during a turn or a breath as a film. */
#ifndef SUPINE_RENDER_PICTURES_H
#define SUPINE_RENDER_PICTURES_H

#include "program/options/breath_turn.h"
#include "program/options/state_options.h"
#include "program/view/render/render.h"

typedef struct supine_pictures {
  const char *output;   /* .png, .pdf or .svg for pictures side by side, .webp for a film */
  const char *postures; /* list of states, side by side or one after another; NULL for a turn */
  bool turns;
  breath_turn turn;
  double breath; /* tidal volume of the breath that a film shows, mL; 0 for a turn */
  supine_volume_options volume;
  supine_from from;   /* state from which displacements are measured */
  const char *inside; /* file of structures inside the lungs; NULL if not given */
  double largest;     /* value at the end of the colour bar, mm; 0 if automatic */
  supine_look look;
  size_t size[2]; /* width and height of the picture, pixels; 0 if automatic */
  supine_view view[SUPINE_VIEWS_MAX];
  size_t view_count;
} supine_pictures;

/* Draw and write the pictures of the lungs of the basis file `path`. */
supine_status supine_command_pictures_draw(const supine_pictures *wanted, const char *path,
                                           supine_error *error);

/* Draw the postures of `wanted` side by side, and write the picture as WebP to `file`. */
supine_status supine_command_pictures_still(const supine_pictures *wanted, const char *path,
                                            FILE *file, supine_error *error);

#endif
