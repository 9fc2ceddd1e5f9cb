/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Read the names of embedded structures ('supine embed'), and make their labels for pictures. */
#ifndef SUPINE_COMMAND_INSIDE_H
#define SUPINE_COMMAND_INSIDE_H

#include "base/arena.h"
#include "program/view/render/render.h"

typedef struct supine_command_names {
  size_t count;
  char **text;          /* [count] name of each structure */
  const uint32_t *part; /* [N] index of each vertex's name in `text` */
  size_t *order;        /* [N] indices of the vertices, sorted by structure, then in input order */
  size_t *begin;        /* [count + 1] index of each structure's first vertex in `order` */
  supine_arena arena;
} supine_command_names;

/* Read the names of embedded structures. Close `names` even after a failure.
 * @retval SUPINE_ERROR_FORMAT  the basis has no names, or malformed ones */
supine_status supine_command_names_open(const supine_basis *basis, supine_command_names *names,
                                        supine_error *error);
void supine_command_names_close(supine_command_names *names);

/* Return the index of the lung that a vertex belongs to. */
size_t supine_command_lung_of(const supine_basis_info *info, size_t vertex);

/* Check that the structures `inside` were embedded in `lungs`; else return SUPINE_ERROR_FORMAT. */
supine_status supine_command_inside_check(const supine_basis *lungs, const supine_basis *inside,
                                          const char *path, supine_error *error);

/* Open the basis file of embedded structures, read their names, and check that they were embedded
 * in `lungs`. Initialise *inside and *names to zero before the call; close both after it, even if
 * it fails. */
supine_status supine_command_inside_open(const supine_basis *lungs, const char *path,
                                         supine_basis **inside, supine_command_names *names,
                                         supine_error *error);

/* Marks of a picture: the vertices of each structure, and a label with name and displacement. */
typedef struct supine_command_marks {
  supine_marks marks;
  supine_mark *mark;
  char (*label)[48];
  supine_arena arena;
} supine_command_marks;

/* Make the marks that show the structures in a pose.
 * @param from  pose from which displacements are measured
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_command_marks_make(const supine_basis *inside,
                                        const supine_command_names *names, const supine_pose *pose,
                                        const supine_pose *from, supine_command_marks *marks,
                                        supine_error *error);
void supine_command_marks_free(supine_command_marks *marks);

#endif
