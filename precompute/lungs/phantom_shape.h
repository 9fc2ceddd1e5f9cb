/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The table that the made lungs are made from. */
#ifndef SUPINE_PHANTOM_SHAPE_H
#define SUPINE_PHANTOM_SHAPE_H

enum { SUPINE_PHANTOM_BAND = 12, SUPINE_PHANTOM_TERMS = 169 };

extern const double supine_phantom_centre[2][3];
extern const double supine_phantom_radius[2][SUPINE_PHANTOM_TERMS];

#endif
