/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Full solves for many directions: for the sampled route and for measuring errors. */
#ifndef SUPINE_SAMPLER_H
#define SUPINE_SAMPLER_H

#include "precompute/projection/projection.h"

/* A model set up to be solved for direction after direction, on all cores: eight of them side by
 * side in the lanes of a solve, as many such solves at a time as half a gigabyte holds. The fields
 * do not depend on the number of cores. */
typedef struct supine_sampler supine_sampler;

/* Relative residual of each solve where the model names none: the fields go into a few functions of
 * orientation, whose error is some hundred times larger. */
#define SUPINE_SAMPLE_TOLERANCE 5e-6

/* The arguments must outlive the sampler. */
supine_status supine_projection_sampler_create(const supine_lungs *lungs, const supine_model *model,
                                               supine_sampler **sampler, supine_error *error);
void supine_projection_sampler_destroy(supine_sampler *sampler);

/* F for unit directions [count, 3] into fields [count, N], which for `warm` hold guesses; `worst`
 * (optional) is raised to the most iterations and the largest residual. */
supine_status supine_projection_sampler_solve(supine_sampler *sampler, size_t count,
                                              const double *directions, bool warm, double *fields,
                                              supine_solve_report *worst, supine_error *error);

#endif
