/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Options of commands that read surfaces: axes and units, landmarks. */
#ifndef SUPINE_SURFACE_OPTIONS_H
#define SUPINE_SURFACE_OPTIONS_H

#include "sh/base/findings.h"

#include "mesh/mesh.h"

#include "program/options/command.h"

/* --axes and --units, a table that fills a supine_mesh_load_options. */
extern const supine_option supine_options_surface_frame[];

/* Matched points of two scans of one person, and which motion between the scans is fitted. */
typedef struct supine_landmark_options {
  const char *path; /* CSV; NULL: none */
  bool reverse, translation, rigid;
} supine_landmark_options;

/* --landmarks, --reverse, --translation and --rigid, a table that fills a supine_landmark_options.
 */
extern const supine_option supine_options_landmarks[];

/* Print the findings about an input, one per line. */
void supine_options_say_findings(const char *command, const supine_findings *findings);

#endif
