/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The full solve at directions that no grid used, for measuring errors. */
#ifndef SUPINE_HELD_OUT_H
#define SUPINE_HELD_OUT_H

#include "precompute/projection/accuracy.h"
#include "precompute/physics/model.h"

/* Owns what a supine_truth points to. */
typedef struct supine_held_out {
  supine_truth truth;
  double *directions, *fields, *functions, *cubic;
} supine_held_out;

/* The linear route: by superposition of the solved columns, which is exact. `forms` are those of
 * the projection's columns; NULL: open surface. */
supine_status supine_accuracy_held_out_linear(const supine_lungs *lungs, const supine_model *model,
                                              const supine_projection *projection,
                                              const supine_volume_forms *forms, size_t count,
                                              supine_held_out *held_out, supine_error *error);

/* Every other route: solved one by one, from what `guess` says, to the tolerance of samples. */
supine_status supine_accuracy_held_out_sampled(const supine_lungs *lungs, const supine_model *model,
                                               const double *directions,
                                               const supine_compression *guess, size_t count,
                                               supine_held_out *held_out, supine_error *error);

void supine_accuracy_held_out_free(supine_held_out *held_out);

#endif
