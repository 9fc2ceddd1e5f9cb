/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Make geodesic spheres: icosahedra whose faces are cut into f^2 triangles each. */
#ifndef SUPINE_GEODESIC_H
#define SUPINE_GEODESIC_H

#include <stddef.h>
#include <stdint.h>

/* Count the vertices, 10 f^2 + 2, and triangles, 20 f^2, at a frequency f. */
size_t supine_phantom_geodesic_vertex_count(size_t frequency);
size_t supine_phantom_geodesic_triangle_count(size_t frequency);

/* Make a sphere of frequency f >= 1: unit vertices [10 f^2 + 2, 3], and outward triangles
 * [20 f^2, 3] whose vertices are numbered from `base`. */
void supine_phantom_geodesic(size_t frequency, uint32_t base, double *vertices,
                             uint32_t *triangles);

#endif
