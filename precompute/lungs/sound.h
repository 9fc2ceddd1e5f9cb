/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Mistakes of whoever gives lungs, found before anything is computed from them. */
#ifndef SUPINE_LUNGS_SOUND_H
#define SUPINE_LUNGS_SOUND_H

#include "precompute/lungs/lungs.h"

/* SUPINE_ERROR_MESH where two of the surfaces are one lung given twice, whatever its resolution,
 * or one is next to nothing beside another. */
supine_status supine_lungs_check_surfaces(const supine_mesh *meshes, size_t count,
                                          supine_error *error);

/* SUPINE_ERROR_MESH where a given midline leaves a lung on both sides, or, of what has two sides,
 * nothing on one. */
supine_status supine_lungs_check_midline(const supine_lungs *lungs, bool two_sided,
                                         supine_error *error);

/* Turns round each lung of a closed model whose volume is negative, and sets `turned`. */
void supine_lungs_face_outwards(supine_lungs *lungs);

#endif
