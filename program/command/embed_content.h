/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Read what is to move with the lungs, and check its axes and units. */
#ifndef SUPINE_EMBED_CONTENT_H
#define SUPINE_EMBED_CONTENT_H

#include "precompute/inside/content.h"

enum { SUPINE_EMBED_LABELS_MOST = 64, SUPINE_EMBED_NAME_MOST = 31 };

/* Labels given by --labels, and a name for each. */
typedef struct supine_embed_labels {
  bool given;
  size_t count; /* number of labels; 0: all labels of the label map */
  unsigned label[SUPINE_EMBED_LABELS_MOST];
  char name[SUPINE_EMBED_LABELS_MOST][SUPINE_EMBED_NAME_MOST + 7];
} supine_embed_labels;

typedef struct supine_embed_content {
  supine_embed_labels labels;
  bool has_grid;
  double grid_spacing; /* mm */
  supine_mesh_load_options load;
} supine_embed_content;

/* Read points, meshes and label maps, or make a grid, like that of an image if `paths` names
 * one. */
supine_status supine_command_embed_read(const supine_inside_shells *shells,
                                        const supine_embed_content *wanted, char **paths,
                                        size_t count, supine_inside_content *content,
                                        supine_error *error);

#endif
