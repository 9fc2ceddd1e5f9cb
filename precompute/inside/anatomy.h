/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file Decide which embedded parts are anatomy, such as airways, vessels and lobes, and which are
 * targets, such as nodules, tumours and landmarks. Targets have a place; of anatomy, the surface,
 * the volume and the mean motion are of interest. */
#ifndef SUPINE_INSIDE_ANATOMY_H
#define SUPINE_INSIDE_ANATOMY_H

#include "precompute/inside/content.h"
#include "precompute/inside/shells.h"

/** Decide for each part whether it is anatomy: a surface that is open, or a part larger than a
 * fifth of a lung. This decision is written to the basis file, where everything else reads it. The
 * size of a part is the volume of the sphere as long as the part (the longest side of its box), or
 * the volume that it encloses, if that is larger; that of a lung is the mean of the lungs in the
 * scan. A point is a target.
 * @param content  may be a grid, which has no parts
 * @param anatomy  [part_count] output: 1 for anatomy, 0 for targets
 * @return SUPINE_ERROR_MEMORY or SUPINE_OK */
supine_status supine_inside_anatomy(const supine_inside_shells *shells,
                                    const supine_inside_content *content, unsigned char *anatomy,
                                    supine_error *error);

#endif
