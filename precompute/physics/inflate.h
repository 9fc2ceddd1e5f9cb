/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The fixed point p = scan - s F(g; p) d(p), by Anderson's acceleration. */
#ifndef SUPINE_INFLATE_H
#define SUPINE_INFLATE_H

#include "precompute/physics/reference.h"

/* Take lungs as scanned to their reference volumes, in place. `found` brings the scan and the
 * volumes, and gets scales, solves and the largest move. Statuses as supine_reference_find. */
supine_status supine_reference_inflate(supine_lungs *lungs, const supine_model *model,
                                       supine_reference *found, supine_error *error);

#endif
