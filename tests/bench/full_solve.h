/* SPDX-License-Identifier: GPL-3.0-or-later */
/* What a frame costs without a basis: equation (2) by a sparse solve for its direction of gravity.
 */
#ifndef SUPINE_FULL_SOLVE_H
#define SUPINE_FULL_SOLVE_H

#include <stdbool.h>
#include <stddef.h>

typedef struct full_solve full_solve;

/* A made pair of lungs of about so many vertices, set up to be solved for any direction in one
 * thread; NULL where that fails. */
full_solve *full_solve_create(size_t vertices);
void full_solve_destroy(full_solve *solve);
size_t full_solve_vertex_count(const full_solve *solve);

/* Force, equilibrium and displaced positions for one direction; the context is a full_solve. */
void full_solve_run(void *context);

#endif
