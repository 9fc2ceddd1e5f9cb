/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Postures and volumes that normals are made for. */
#ifndef SUPINE_NORMALS_STATES_H
#define SUPINE_NORMALS_STATES_H

#include "precompute/normals/normals.h"

/* Postures and volumes, as monomials of weights and gains. */
typedef struct supine_normals_states {
  size_t count; /* S, of those that are reached */
  size_t room;
  double *phi; /* [G, room, 3, terms] */
  double range[2];
} supine_normals_states;

/* Spreads up to `count` over the sphere and the volumes from rest to the file's surface, or where
 * no rest is known from a tenth below it to six tenths above; `shift` in 0 ... 1 moves them all
 * between each other. SUPINE_ERROR_MEMORY */
supine_status supine_normals_states_create(const supine_normals_surface *surface, size_t count,
                                           double shift, supine_normals_states *states);
void supine_normals_states_free(supine_normals_states *states);

#endif
