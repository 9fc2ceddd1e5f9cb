/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Make a synthetic pair of lungs, for trials without a scan. */
#ifndef SUPINE_PHANTOM_H
#define SUPINE_PHANTOM_H

#include "mesh/mesh.h"

/** Fewest and most vertices of a pair of synthetic lungs. */
enum { SUPINE_PHANTOM_VERTICES_MIN = 84, SUPINE_PHANTOM_VERTICES_MAX = 20000000 };

/** Make two closed lungs, left first, of a given total volume.
 *
 * Each is a geodesic sphere (10 f^2 + 2 vertices at frequency f), mapped to a lung by spherical
 * harmonics of each coordinate to band 4; the pair is scaled about the origin to the volume.
 * @param vertices     number wanted in total; rounded to that of two equal geodesic spheres
 * @param millilitres  volume of both lungs together, > 0; adults have about 6000 at full
 *                     inflation
 * @param mesh         written on success */
supine_status supine_lungs_phantom_create(size_t vertices, double millilitres, supine_mesh *mesh,
                                          supine_error *error);

/** Return the number of vertices, 10 f^2 + 2, or of triangles, 20 f^2, of a geodesic sphere. It is
 * an icosahedron with each face cut into f^2 triangles; f is the frequency. */
size_t supine_lungs_phantom_geodesic_vertex_count(size_t frequency);
size_t supine_lungs_phantom_geodesic_triangle_count(size_t frequency);

/** Make a geodesic sphere of frequency f >= 1: unit vertices [10 f^2 + 2, 3], and outward triangles
 * [20 f^2, 3] whose vertices are numbered from `base`. */
void supine_lungs_phantom_geodesic(size_t frequency, uint32_t base, double *vertices,
                                   uint32_t *triangles);

#endif
