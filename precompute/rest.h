/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The resting volume of a field in any posture. */
#ifndef SUPINE_REST_H
#define SUPINE_REST_H

#include "precompute/physics/reference.h"
#include "precompute/projection/projection.h"

/* What lungs hold at rest, mL beyond the reference, as real harmonics of bands 0 to 2 [9]. Both
 * lungs of a pair have one scale, found where they, healthy, hold the share of their posture; so
 * does a lung alone with its mirror image, so that it is emptier lying on its own side than on the
 * other. forms: of the compression's coefficients. SUPINE_ERROR_NUMERICAL: the surface folds before
 * it holds so little. */
supine_status supine_precompute_rest(const supine_lungs *lungs, const supine_model *model,
                                     const supine_reference *reference,
                                     const supine_compression *compression,
                                     const supine_volume_forms *forms, double harmonics[9],
                                     supine_error *error);

#endif
