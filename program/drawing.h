/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Draw the still pictures and animations of 'supine render'. */
#ifndef SUPINE_COMMAND_DRAWING_H
#define SUPINE_COMMAND_DRAWING_H

#include <supine/compare.h>

#include "program/inside.h"
#include "program/options/breath_frames.h"
#include "program/options/state_options.h"
#include "program/render/render.h"

/* The options of 'supine render'. */
typedef struct supine_command_drawing {
  const char *output;
  const char *postures;
  supine_volume_options volume;
  supine_from from;     /* state that colours and displacements are measured from */
  const char *inside;   /* file of --inside; NULL: none */
  double largest;       /* end of the colour bar, mm; 0: automatic */
  double opacity;       /* opacity of the lungs; 0: not given */
  size_t width, height; /* pixels; 0: automatic */
  supine_view view[SUPINE_VIEWS_MAX];
  size_t view_count;
  unsigned theme; /* 0: light; 1: dark */
  bool turns;
  breath_turn turn;
} supine_command_drawing;

/* What a picture shows of one posture. */
typedef struct supine_command_drawn {
  supine_pose pose;
  float *value; /* [N] displacement, mm */
  char subtitle[96];
  supine_command_marks marks;
} supine_command_drawn;

/* Objects needed for drawing. Set the first three members, then open the studio; close it also
 * after a failure. */
typedef struct supine_command_studio {
  const supine_basis *basis;
  const supine_command_drawing *wanted;
  const supine_reference_pose *from;
  supine_compare *compare;
  supine_renderer *renderer;
  supine_basis *inside; /* or NULL */
  supine_command_names names;
  double ends[2]; /* largest 95th percentile and largest displacement of the states found, mm */
} supine_command_studio;

supine_status supine_command_studio_open(supine_command_studio *studio, supine_error *error);
void supine_command_studio_close(supine_command_studio *studio);

/* Compute the pose for a posture, the values to colour by and the line below its name. */
supine_status supine_command_drawn_find(supine_command_studio *studio,
                                        const supine_posture_item *item,
                                        supine_command_drawn *found, supine_error *error);

/* Compute the marks of the structures inside in a state found; none without --inside. */
supine_status supine_command_drawn_mark(const supine_command_studio *studio,
                                        supine_command_drawn *found, supine_error *error);

/* Return the picture of `count` panels.
 * @param label  [128] set to the text of the colour bar; must outlive the picture */
supine_picture supine_command_drawing_picture(const supine_command_studio *studio,
                                              const supine_panel *panels, size_t count,
                                              char *label);

/* Return the panel of a state. */
supine_panel supine_command_drawn_panel(const supine_command_drawing *wanted,
                                        const supine_command_drawn *shown, const char *title,
                                        const double gravity[3]);

/* Draw the turn as an animation, and write it. */
supine_status supine_command_drawing_turn(supine_command_studio *studio, supine_error *error);

/* Read "supine:left:10s", the value of --turn. Statuses as supine_option_reader. */
supine_status supine_command_read_turn(const char *value, breath_turn *turn, supine_error *error);

#endif
