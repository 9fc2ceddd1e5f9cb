/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Full solves for many directions: for the sampled route and for measuring errors. */
#ifndef SUPINE_SAMPLED_H
#define SUPINE_SAMPLED_H

#include "precompute/projection/projection.h"

/* A model set up to be solved for direction after direction, on all cores. */
typedef struct supine_sampler supine_sampler;

/* The arguments must outlive the sampler. tolerance: relative residual, 0: the solver's default. */
supine_status supine_projection_sampler_create(const supine_lungs *lungs, const supine_model *model,
                                               double tolerance, supine_sampler **sampler,
                                               supine_error *error);
void supine_projection_sampler_destroy(supine_sampler *sampler);

/* F for unit directions [count, 3] into fields [count, N]; `worst` (optional) is raised to the most
 * iterations and the largest residual. */
supine_status supine_projection_sampler_solve(supine_sampler *sampler, size_t count,
                                              const double *directions, double *fields,
                                              supine_solve_report *worst, supine_error *error);

#endif
