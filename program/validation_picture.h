/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Draw the lungs, coloured by the distance between predicted and scanned surface. */
#ifndef SUPINE_VALIDATION_PICTURE_H
#define SUPINE_VALIDATION_PICTURE_H

#include "precompute/validation/validation.h"

/* Draw one panel for each state that has a scanned surface. */
supine_status supine_command_draw_errors(const supine_validation *s, const char *path,
                                         supine_error *error);

#endif
