/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Lists of orientations on the command line: names, tilted names, gravity triples. */
#ifndef SUPINE_POSTURE_LIST_H
#define SUPINE_POSTURE_LIST_H

#include "program/options/orientation.h"

enum { SUPINE_POSTURE_LIST_MAX = 32 };

/* One orientation: as the user wrote it, and its unit direction of gravity. */
typedef struct supine_posture_item {
  char name[SUPINE_POSTURE_NAME_MAX];
  double gravity[3];
} supine_posture_item;

typedef struct supine_posture_list {
  size_t count;
  supine_posture_item item[SUPINE_POSTURE_LIST_MAX];
} supine_posture_list;

/* What a list may hold, for a command's help. */
#define SUPINE_POSTURE_LIST_HELP                                                                   \
  "A posture is a name (supine, prone, left, right, upright, inverted, or a DICOM patient "        \
  "position), a name with a tilt towards the head in degrees (supine+15: Trendelenburg), "         \
  "or a gravity in body axes, X:Y:Z (0.6:0:-0.8)."

/* Parse "supine,prone,supine+15,0.6:0:-0.8".
 * @retval SUPINE_ERROR_ARGUMENT */
supine_status supine_options_posture_list_parse(const char *text, supine_posture_list *list,
                                                supine_error *error);

/* Return a posture's name in words: "left side" for "left"; other names unchanged. */
const char *supine_options_posture_label(const char *name);

#endif
