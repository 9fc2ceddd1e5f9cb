/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The resting volume of a field in any posture. */
#ifndef SUPINE_REST_H
#define SUPINE_REST_H

#include "precompute/physics/reference.h"
#include "precompute/projection/projection.h"

/* What each lung holds at rest, mL beyond the reference surface of the file, as real harmonics of
 * bands 0 to 2 [G, 9]. share: of collapsed lungs. forms: of the compression's coefficients.
 * SUPINE_ERROR_NUMERICAL: the surface folds before it holds so little in some posture. */
supine_status supine_precompute_rest(const supine_reference *reference, const double share[2],
                                     const supine_compression *compression,
                                     const supine_volume_forms *forms, double harmonics[2][9],
                                     supine_error *error);

#endif
