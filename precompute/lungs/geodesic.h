/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Geodesic spheres: an icosahedron whose faces are cut into f^2 triangles. */
#ifndef SUPINE_GEODESIC_H
#define SUPINE_GEODESIC_H

#include <stddef.h>
#include <stdint.h>

/* 10 f^2 + 2 vertices and 20 f^2 triangles. */
size_t supine_phantom_geodesic_vertex_count(size_t frequency);
size_t supine_phantom_geodesic_triangle_count(size_t frequency);

/* Unit vertices [10 f^2 + 2, 3] and outward triangles [20 f^2, 3], numbered from `base`; f >= 1. */
void supine_phantom_geodesic(size_t frequency, uint32_t base, double *vertices,
                             uint32_t *triangles);

#endif
