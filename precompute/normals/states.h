/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Postures and volumes that normals are made for. */
#ifndef SUPINE_NORMALS_STATES_H
#define SUPINE_NORMALS_STATES_H

#include "precompute/normals/normals.h"

/* Monomials of the weights and gains in some states. */
typedef struct supine_normals_states {
  size_t count;    /* S, those that are reached */
  size_t room;     /* states that were asked for */
  double *phi;     /* [G, room, 3, terms] */
  double range[2]; /* as of supine_normals_modes */
} supine_normals_states;

/* Spread up to `count` states over the sphere and the volumes from rest to the file's surface, or
 * where no rest is known, largest displacements of -15 to 60 mm. Another `shift`, 0 to 1, gives
 * states between the others.
 * SUPINE_ERROR_MEMORY */
supine_status supine_normals_states_create(const supine_normals_surface *surface, size_t count,
                                           double shift, supine_normals_states *states);
void supine_normals_states_free(supine_normals_states *states);

#endif
