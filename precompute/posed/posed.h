/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute volume, positions, surface and expected errors of a basis in a pose. */
#ifndef SUPINE_POSED_H
#define SUPINE_POSED_H

#include <supine/locate.h>
#include <supine/runtime.h>

#include "mesh/mesh.h"

/* Return the volume of all lungs together in a pose, mL. */
double supine_posed_volume(const supine_basis *basis, const supine_pose *pose);

/* Compute all vertices [N, 3] in a pose or, if `pose` is NULL, of the reference surface, mm. */
supine_status supine_posed_positions(const supine_basis *basis, const supine_pose *pose,
                                     double *positions, supine_error *error);

/* Copy the surface in a pose or, if `pose` is NULL, the reference surface into a mesh. Release the
 * mesh with supine_mesh_free, even after a failure. */
supine_status supine_posed_mesh(const supine_basis *basis, const supine_pose *pose,
                                supine_mesh *mesh, supine_error *error);

/* Expected errors of the displacements from one state to another; from the state of the scan, these
 * are the errors of positions. Initialise with zeros, and release with supine_posed_expected_free.
 */
typedef struct supine_expected {
  float *sigma; /* expected error of each vertex's displacement, mm; NULL if unknown */
  /* The same of each vertex's position on another day than that of the scan; NULL if unknown. */
  float *another;
  double rms, largest; /* RMS and maximum of `sigma` over the vertices, mm */
  double another_rms;  /* RMS of `another` over the vertices, mm */
  bool turned;         /* whether the displacements include a change of posture */
} supine_expected;

/* Compute the expected errors of the displacements from one state to another. They are unknown for
 * open surfaces and for displacements computed by another simulator; `expected` is then unchanged.
 */
supine_status supine_posed_expected(const supine_basis *basis, const supine_state *state,
                                    const supine_state *from, supine_expected *expected,
                                    supine_error *error);

/* Expected errors of the positions in a state, and of the displacements to it from another state;
 * they are equal if the other state is that of the scan. Initialise with zeros, and release with
 * supine_posed_errors_free. */
typedef struct supine_errors {
  supine_expected position, moved;
} supine_errors;

/* Compute the expected errors of a state. Statuses: as supine_posed_expected. */
supine_status supine_posed_errors(const supine_basis *basis, const supine_state *state,
                                  const supine_state *from, supine_errors *errors,
                                  supine_error *error);

/* Write `sigma`, `rms` and `largest` of a basis of another simulator's fields: the error of the fit
 * to the simulator, not to a person. All are unchanged if the basis lacks these errors. */
supine_status supine_posed_simulator_error(const supine_basis *basis, const supine_state *state,
                                           supine_expected *expected, supine_error *error);
void supine_posed_errors_free(supine_errors *errors);

/* Set `rms`, `largest` and `another_rms` from the errors of `count` vertices. */
void supine_posed_expected_measure(size_t count, supine_expected *expected);
void supine_posed_expected_free(supine_expected *expected);

#endif
