/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The part of 'supine compare' that tells how far each named point moves between postures. */
#ifndef SUPINE_COMPARE_CONTENT_H
#define SUPINE_COMPARE_CONTENT_H

#include <supine/runtime.h>

#include "program/options/orientation.h"
#include "program/options/state_options.h"

/* Prints, for every two postures and every name, how far what goes by it moves and where to: the
 * mean over its vertices. As a table, or as JSON; and as CSV where `csv` is not NULL.
 * @param volume  in every posture */
supine_status supine_command_compare_content(const supine_basis *basis,
                                             const supine_posture_list *postures,
                                             const supine_state *volume, bool json, const char *csv,
                                             supine_error *error);

#endif
