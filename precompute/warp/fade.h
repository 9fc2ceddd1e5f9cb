/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Internal: let a displacement field fall to 0 outside the lungs. */
#ifndef SUPINE_FADE_H
#define SUPINE_FADE_H

#include "precompute/warp/field.h"

/* Extend the field from the nodes in and near the lungs, and multiply it by a factor that is 1 up
 * to the diagonal of a cell from them, so that the field in the lungs stays as it is. From there,
 * the factor falls linearly to 0 over the distance of supine_field_fade, and at the latest at the
 * border of the grid.
 * @param field  depths at the nodes that are not known: -INFINITY; they are replaced
 * @param known  [nodes] 1 at the nodes at which the field is given, otherwise 0 */
void supine_field_fade_out(supine_field *field, const unsigned char *known);

#endif
