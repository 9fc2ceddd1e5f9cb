/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Write where structures are as markups of 3D Slicer, which mesh/io/points.h reads. */
#ifndef SUPINE_OPTIONS_MARKUPS_H
#define SUPINE_OPTIONS_MARKUPS_H

#include "program/options/facts.h"
#include "program/options/inside.h"

#define SUPINE_MARKUPS_ENDING ".mrk.json"

enum { SUPINE_MARKUPS_DESCRIPTION = 256 + SUPINE_CAVEATS_SIZE }; /* bytes */

/* Return whether `path` is to be written as markups: whether it ends in .json. */
bool supine_options_markups_named(const char *path);

/* Write what the numbers of markups mean, and what the basis assumes.
 * @param from  name of the state that displacements count from */
void supine_options_markups_describe(const supine_basis *basis, const char *from,
                                     char text[SUPINE_MARKUPS_DESCRIPTION]);

/* Return a list of control points, one for each target: its name and position, mm, LPS. Its length
 * of displacement and its expected errors are measurements of the list, with the names of the
 * columns of CSV files. A measurement that any target lacks (NAN) is left out.
 * @param name         of the list, such as its state
 * @param description  what the numbers mean */
json_t *supine_options_markup(const char *name, const char *description,
                              const supine_target *targets, size_t count);

/* Write an array of lists, and release it. */
supine_status supine_options_markups_write(const char *path, json_t *lists, supine_error *error);

#endif
