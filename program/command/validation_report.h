/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Print the distances that a validation found, and draw those of the surface. */
#ifndef SUPINE_VALIDATION_REPORT_H
#define SUPINE_VALIDATION_REPORT_H

#include "precompute/validation/validation.h"

/* Print the results to standard output. */
void supine_command_print_validation(const supine_validation *s);

/* Draw one panel for each state that has a scanned surface. */
supine_status supine_command_draw_errors(const supine_validation *s, const char *path,
                                         supine_error *error);

#endif
