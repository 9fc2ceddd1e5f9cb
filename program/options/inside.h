/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Read the names of embedded structures ('supine embed'), and make their labels for pictures. */
#ifndef SUPINE_COMMAND_INSIDE_H
#define SUPINE_COMMAND_INSIDE_H

#include <jansson.h>

#include "base/arena.h"

#include "precompute/posed/posed.h"

#include "program/view/render/render.h"

typedef struct supine_options_names {
  size_t count;
  char **text;                  /* [count] name of each structure */
  const uint32_t *part;         /* [N] index of each vertex's name in `text` */
  const unsigned char *anatomy; /* [count] 1: airways, a lobe, ...; 0: a target (anatomy.h) */
  size_t *order; /* [N] indices of the vertices, sorted by structure, then in input order */
  size_t *begin; /* [count + 1] index of each structure's first vertex in `order` */
  supine_arena arena;
} supine_options_names;

/* Read the names of embedded structures. Close `names` even after a failure. */
supine_status supine_options_names_open(const supine_basis *basis, supine_options_names *names,
                                        supine_error *error);
void supine_options_names_close(supine_options_names *names);

/* Open the basis file of embedded structures, read their names, and check that they were embedded
 * in `lungs`. Initialise *inside and *names to zero before the call; close both after it, even if
 * it fails. */
supine_status supine_options_inside_open(const supine_basis *lungs, const char *path,
                                         supine_basis **inside, supine_options_names *names,
                                         supine_error *error);

/* Where a group of vertices is, and how it has moved. */
typedef struct supine_target {
  const char *name;
  size_t lung;      /* index of the lung of the first vertex */
  double at[3];     /* mean position of the vertices, mm */
  double move[3];   /* displacement of the mean position, mm */
  double moved;     /* length of `move`, mm */
  double volume[2]; /* volume before and after, mL; NAN if it is no closed mesh; 0 without meshes */
  bool anatomy;     /* whether it is anatomy, such as airways or a lobe, and no target */
  /* RMS of the vertices' expected errors, mm; NAN if unknown: of the position, in the session of
   * the scan and on another day; and of the displacement. */
  double error, another_error, moved_error;
} supine_target;

/* Compute where the structures are in pose[1], and how they have moved from pose[0].
 * @param errors   of the positions in pose[1], and of the displacements
 * @param each     true for a target for each vertex, false for one for each structure
 * @param targets  output: array of targets in the order of `names`, which the caller frees */
supine_status supine_options_targets_find(const supine_basis *inside,
                                          const supine_options_names *names,
                                          const supine_pose *const pose[2],
                                          const supine_errors *errors, bool each,
                                          supine_target **targets, supine_error *error);

/* Return the index of the target to tell of first: that with the largest displacement, in multiples
 * of its expected error. Targets come before anatomy. */
size_t supine_options_targets_first(const supine_target *targets, size_t count);

/* Return how many targets are to be told of before target `which`, in the same order. */
size_t supine_options_targets_before(const supine_target *targets, size_t count, size_t which);

/* Free *targets; for SUPINE_FREED_BY. */
void supine_options_targets_free(supine_target **targets);

/* Write the direction of a target's displacement in words, with at most `most` parts and the
 * largest first: "12 to the feet, 7 to the front". For a displacement below its own error, write
 * "0.7 mm, within its error of 3.6". Return `way`. */
const char *supine_options_target_way(const supine_target *target, size_t most, char way[96]);

/* Subtract a displacement, mm, such as that of the hilum, from a target's position and
 * displacement. */
void supine_options_target_shift(supine_target *target, const double shift[3]);

/* Return a target as JSON: its name, displacement, and the expected errors of its position and of
 * the displacement. */
json_t *supine_options_target_json(const supine_target *target);

enum { SUPINE_SHOWN_NAME_SIZE = 128 }; /* bytes that hold supine_options_shown_name */

/* Write a name as a line of a picture shows it: its first letters, at most `letters`, and kept
 * apart from the rest of the line where text is shaped, as it may be written from right to left.
 * Return `shown`. */
const char *supine_options_shown_name(const char *name, size_t letters,
                                      char shown[SUPINE_SHOWN_NAME_SIZE]);

enum { SUPINE_LABELS_MAX = 8 }; /* largest number of targets that a picture names */

/* Raise score[i] to the displacement of target i, in multiples of its expected error or, where that
 * is unknown, in mm. That of anatomy becomes -1.
 * @param score  [count] of several states; begin with zeros */
void supine_options_targets_score(const supine_target *targets, size_t count, double *score);

/* Marks of a picture: the vertices of each structure, and a label with name and displacement. */
typedef struct supine_options_marks {
  supine_marks marks;
  supine_mark *mark;
  char (*label)[SUPINE_SHOWN_NAME_SIZE + 32];
  supine_target selected; /* the target with the largest score, of which a caption tells */
  size_t unnamed;         /* number of targets without a label */
  supine_arena arena;
} supine_options_marks;

/* Make the marks that show the structures in pose[1], with arrows from where they were in pose[0].
 * Those that `marks` held before are freed. Names of up to SUPINE_LABELS_MAX targets, and of the
 * structures that have a colour of their own, are written.
 * @param errors  as supine_options_targets_find
 * @param score  [names->count] of supine_options_targets_score */
supine_status supine_options_marks_make(const supine_basis *inside,
                                        const supine_options_names *names,
                                        const supine_pose *const pose[2],
                                        const supine_errors *errors, const double *score,
                                        supine_options_marks *marks, supine_error *error);
void supine_options_marks_free(supine_options_marks *marks);

#endif
