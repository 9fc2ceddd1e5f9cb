/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * A made pair of lungs, for trying things without anybody's scan. */
#ifndef SUPINE_PHANTOM_H
#define SUPINE_PHANTOM_H

#include "mesh/mesh.h"

/** Fewest and most vertices of a phantom. */
enum { SUPINE_PHANTOM_VERTICES_MIN = 84, SUPINE_PHANTOM_VERTICES_MAX = 20000000 };

/** Makes two closed lungs, left first, of a given volume in all.
 *
 * Each is a geodesic sphere (10 f^2 + 2 vertices at frequency f) pushed out to a radius given by
 * harmonics of band 12, and the pair is scaled about the origin to the volume.
 *
 * @param vertices   wanted in all; the result is the nearest pair of geodesic spheres
 * @param millilitres  volume of both lungs together, > 0; an adult at full inflation holds about
 * 6000
 * @param mesh       zero-initialised; written on success
 * @retval SUPINE_ERROR_ARGUMENT, SUPINE_ERROR_MEMORY */
supine_status supine_phantom_create(size_t vertices, double millilitres, supine_mesh *mesh,
                                    supine_error *error);

#endif
