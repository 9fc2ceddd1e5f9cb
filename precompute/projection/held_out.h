/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The full solve at directions that no grid used, for measuring errors. */
#ifndef SUPINE_HELD_OUT_H
#define SUPINE_HELD_OUT_H

#include "precompute/physics/model.h"
#include "precompute/projection/accuracy.h"

/* Owns what a supine_truth points to, but for its columns. */
typedef struct supine_held_out {
  supine_truth truth;
  double *directions, *functions, *cubic;
} supine_held_out;

/* Finds it by superposition of the solved columns, which is as exact as the projection's span.
 * @param directions  [N, 3] d
 * @param forms       of the projection's columns; NULL: volumes of each direction's field alone */
supine_status supine_accuracy_held_out(const supine_lungs *lungs, const supine_model *model,
                                       const double *directions,
                                       const supine_projection *projection,
                                       const supine_volume_forms *forms, size_t count,
                                       supine_held_out *held_out, supine_error *error);

void supine_accuracy_held_out_free(supine_held_out *held_out);

#endif
