/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Write where structures are as markups of 3D Slicer, which mesh/io/points.h reads. */
#ifndef SUPINE_OPTIONS_MARKUPS_H
#define SUPINE_OPTIONS_MARKUPS_H

#include "program/options/inside.h"

#define SUPINE_MARKUPS_ENDING ".mrk.json"

/* Return whether `path` is to be written as markups: whether it ends in .json. */
bool supine_options_markups_named(const char *path);

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
