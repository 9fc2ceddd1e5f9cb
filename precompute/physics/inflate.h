/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The fixed point p_j = scan_j - A_j F(g; p) d_j(p), by Anderson's acceleration. */
#ifndef SUPINE_INFLATE_H
#define SUPINE_INFLATE_H

#include "precompute/physics/reference.h"

/* Move scanned lungs to their reference volumes, in place. `found` holds the scan and the
 * volumes; gains, solves and the largest move are written. Statuses as supine_reference_find. */
supine_status supine_reference_inflate(supine_lungs *lungs, const supine_model *model,
                                       supine_reference *found, supine_error *error);

/* Find the gains of the scan, for a field of the reference surface applied to the scan, that
 * match the volumes of full inflation, of rest and of the scan.
 * @param scan        closed lungs with the scan's vertices
 * @param directions  [N, 3] d, mm
 * @param amounts     [N] F along the scan's gravity
 * @param reference   its volumes; scan_gains are written
 * @retval SUPINE_ERROR_NUMERICAL  the surface folds on the way */
supine_status supine_reference_find_gains(const supine_lungs *scan, const double bend[3],
                                          const double *directions, const double *amounts,
                                          supine_reference *reference, supine_error *error);

#endif
