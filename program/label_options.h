/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Label maps in place of meshes: their options, and what is said of what was found. */
#ifndef SUPINE_LABEL_OPTIONS_H
#define SUPINE_LABEL_OPTIONS_H

#include "sh/base/findings.h"

#include "mesh/mesh.h"

#include "program/options/command.h"

/* A table of options that fills a supine_label_options. */
extern const supine_option supine_command_label_options[];

typedef struct supine_label_options {
  const char *labels; /* NULL: by those that are there */
  double edge, close; /* mm; 0: the default, none */
  const char *surfaces;
} supine_label_options;

/* True where the inputs are label maps; SUPINE_EXIT_USAGE, after a message, where only some are, or
 * where there are none and options are given that are of them alone. */
int supine_command_labels_check(const supine_label_options *options, const char *command,
                                char **paths, size_t count, bool *maps);

/* What loading label maps gives. */
typedef struct supine_command_maps {
  supine_axes axes;      /* in: of the headers' coordinates, AUTO: as they say; out: those taken */
  supine_mesh *surfaces; /* [2], of which `count` are written */
  size_t count;
  int sides[2]; /* +1 left, -1 right */
  supine_findings *findings;
} supine_command_maps;

/* The lungs' surfaces; prints what the maps hold. An exit code. */
int supine_command_labels_load(const supine_label_options *options, const char *command,
                               char **paths, size_t path_count, supine_command_maps *maps);

#endif
