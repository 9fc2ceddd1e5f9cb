/* SPDX-License-Identifier: GPL-3.0-or-later */
/* 'supine compare' for structures inside the lungs. */
#ifndef SUPINE_COMPARE_CONTENT_H
#define SUPINE_COMPARE_CONTENT_H

#include <supine/runtime.h>

#include "program/options/state_options.h"

/* Print the mean displacement of each named structure between every two postures, as a table or as
 * JSON.
 * @param volume  of the lungs in every posture */
supine_status supine_command_compare_content(const supine_basis *basis,
                                             const supine_posture_list *postures,
                                             const supine_state *volume, bool json,
                                             supine_error *error);

#endif
