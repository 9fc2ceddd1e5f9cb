/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Solve for the equilibrium of forces on a surface by one of two models: the network of masses and
 * springs of [Santhanam2008] (network.h), or a smoothing, whose result does not depend on the mesh
 * (smoothing.h). */
#ifndef SUPINE_EQUILIBRIUM_H
#define SUPINE_EQUILIBRIUM_H

#include "precompute/lungs/lungs.h"

/** The linear equations for the equilibrium of one surface. Not thread-safe. */
typedef struct supine_equilibrium supine_equilibrium;

/** Assemble the equations of a surface whose stiffness is 1 everywhere but in lesions.
 * @param topology  edges of the mesh; must outlive the equilibrium
 * @param reach     smoothing length R, mm; 0 for the network
 * @param lesions   [vertices] factors on the normalised stiffness in lesions, or NULL; copied. They
 *   act only in the network
 * @param equilibrium  written; release with supine_physics_equilibrium_destroy */
supine_status supine_physics_equilibrium_create(const supine_mesh *mesh,
                                                const supine_topology *topology, double reach,
                                                const double *lesions,
                                                supine_equilibrium **equilibrium,
                                                supine_error *error);
void supine_physics_equilibrium_destroy(supine_equilibrium *equilibrium);

/** Replace the vertex positions, the smoothing length and the stiffness of an equilibrium. This is
 * faster than creating a new equilibrium. The model stays that of the creation.
 * @param reach      smoothing length, mm; must be 0 for the network
 * @param stiffness  as for supine_physics_equilibrium_set_stiffness */
supine_status supine_physics_equilibrium_set_shape(supine_equilibrium *equilibrium,
                                                   const supine_mesh *mesh, double reach,
                                                   const double *stiffness, supine_error *error);

/** Set the stiffness of the vertices. It acts only in the network, and changes the matrix, which
 * the next solve factorises again.
 * @param stiffness  [vertices] above 0, scaled to a geometric mean of 1; NULL for 1 everywhere */
supine_status supine_physics_equilibrium_set_stiffness(supine_equilibrium *equilibrium,
                                                       const double *stiffness,
                                                       supine_error *error);

/** Compute the force that each of N vertices retains after exchange with its neighbours, for each
 * of `count` applied forces. The first solve factorises the matrix, and large
 * surfaces factorise it in every call (factorisation.h): solve for all forces in one call.
 * @param force     [vertices, count] applied forces
 * @param retained  [vertices, count] forces that the vertices retain, written; may be `force` */
supine_status supine_physics_equilibrium_solve(supine_equilibrium *equilibrium, size_t count,
                                               const double *force, double *retained,
                                               supine_error *error);

/** Invert supine_physics_equilibrium_solve: find the force [vertices] to apply so that each vertex
 * retains a given force, retained [vertices] ([Santhanam2008] IV-B.3). */
supine_status supine_physics_equilibrium_force(supine_equilibrium *equilibrium,
                                               const double *retained, double *force,
                                               supine_error *error);

/** Apply a unit force to `vertex`, and compute the part of it that remains on each vertex: a column
 * [vertices] of the transfer matrix of [Santhanam2008], equation (2). */
supine_status supine_physics_transfer_column(supine_equilibrium *equilibrium, size_t vertex,
                                             double *column, supine_error *error);

#endif
