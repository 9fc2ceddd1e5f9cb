/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Choose the postures and volumes that modes of normals are found from and measured on. */
#ifndef SUPINE_NORMALS_STATES_H
#define SUPINE_NORMALS_STATES_H

#include "precompute/normals/normals.h"

/* Monomials of the weights and gains in some states. */
typedef struct supine_normals_states {
  size_t count;    /* S, states that are reached */
  size_t room;     /* states that were requested */
  double *phi;     /* [G, room, 3, terms] */
  double range[2]; /* as in supine_normals_modes */
} supine_normals_states;

/* Spread up to `count` states over the sphere and over the volumes from rest to the reference
 * surface, or if rest is unknown, over largest displacements of -15 to 60 mm. Another `shift`, 0 to
 * 1, gives states between the others. Release them with supine_normals_states_free.
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_normals_states_create(const supine_normals_surface *surface, size_t count,
                                           double shift, supine_normals_states *states);
void supine_normals_states_free(supine_normals_states *states);

#endif
