/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Structures embedded in the lungs, shown with them: a file of 'supine embed' beside its basis. */
#ifndef SUPINE_COMMAND_INSIDE_H
#define SUPINE_COMMAND_INSIDE_H

#include "program/render/render.h"

#include "program/names.h"

/* SUPINE_ERROR_FORMAT where the content was not made from this basis. */
supine_status supine_command_inside_check(const supine_basis *lungs, const supine_basis *inside,
                                          const char *path, supine_error *error);

/* Open the structures and their names; both arguments start zeroed and must be closed also after a
 * failure. Statuses of opening, of the names, and of the check. */
supine_status supine_command_inside_open(const supine_basis *lungs, const char *path,
                                         supine_basis **inside, supine_command_names *names,
                                         supine_error *error);

/* Make the marks of a picture: each named point with its displacement; the vertices of meshes, with
 * the name at the middle. */
typedef struct supine_command_marks {
  supine_marks marks;
  supine_mark *mark;
  char (*label)[48];
} supine_command_marks;

/* @param from  what moves count from
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_command_marks_make(const supine_basis *inside,
                                        const supine_command_names *names, const supine_pose *pose,
                                        const supine_pose *from, supine_command_marks *marks,
                                        supine_error *error);
void supine_command_marks_free(supine_command_marks *marks);

#endif
