/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file Measure the volumes that the lungs of a basis can hold. */
#ifndef SUPINE_VOLUME_RANGE_H
#define SUPINE_VOLUME_RANGE_H

#include <supine/runtime.h>

/** Measure the least and the largest volume of each lung, mL, in 26 directions of gravity: between
 * 10 and 120 % of full inflation, the volumes around full inflation at which at most 1 % of the
 * triangles turn over (checks volume-least, volume-most and folds).
 * @param range  [SUPINE_RANGE_NODES, lung_count, 2] written (runtime/checks.h) */
supine_status supine_precompute_volume_range(const supine_basis *basis, double *range,
                                             supine_error *error);

#endif
