/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Open a basis, copy its surface, and compute its expected errors. */
#ifndef SUPINE_BASIS_INPUT_H
#define SUPINE_BASIS_INPUT_H

#include <stdio.h>

#include <supine/locate.h>
#include <supine/runtime.h>

#include "mesh/mesh.h"

#include "program/options/command.h"

/* Option table that holds only --as-scanned, which sets a bool. */
extern const supine_option supine_options_as_scanned[];

/* Open a basis without its stored normals, and check that its surface is closed. The caller must
 * close the basis even after a failure.
 * @retval SUPINE_ERROR_OPEN_SURFACE  the surface encloses no volume
 * @retval any status of supine_basis_open_with */
supine_status supine_options_basis_open(const char *path, supine_storage storage,
                                        supine_basis **basis, supine_error *error);

/* Close *basis; for SUPINE_FREED_BY. */
void supine_options_basis_close(supine_basis **basis);

/* Check that the surface of a basis encloses a volume. `path` names the file in the message.
 * @retval SUPINE_ERROR_OPEN_SURFACE */
supine_status supine_options_basis_closed(const supine_basis *basis, const char *path,
                                          supine_error *error);

/* If `wanted` is true, set the axes and the unit of `save` to those of the scan.
 * @retval SUPINE_ERROR_FORMAT  the basis does not state the axes and the unit of its scan */
supine_status supine_options_basis_frame(const supine_basis *basis, bool wanted,
                                         supine_mesh_save_options *save, supine_error *error);

/* Write the name of a basis file without its folder and the ending .safetensors, as UTF-8. */
void supine_options_basis_title(const char *path, char *title, size_t size);

/* Return the volume of all lungs together in a pose, mL. */
double supine_options_basis_volume(const supine_basis *basis, const supine_pose *pose);

/* Return all vertices [N, 3] in a pose (NULL: of the reference surface), mm, or NULL if out of
 * memory. The caller frees them. */
double *supine_options_basis_positions(const supine_basis *basis, const supine_pose *pose);

/* Copy the surface in a pose or, if `pose` is NULL, the reference surface into a mesh; release the
 * mesh with supine_mesh_free. */
supine_status supine_options_basis_mesh(const supine_basis *basis, const supine_pose *pose,
                                        supine_mesh *mesh, supine_error *error);

/* Option table that holds only --frame, which sets an int: 1 to subtract the displacement of the
 * hilum, else 0. */
extern const supine_option supine_options_hilum_frame[];

/* Compute the displacement of the hilum (precompute/inside/shells.h) from one pose to another, mm;
 * 0 if the file does not determine it.
 * @retval SUPINE_ERROR_UNSUPPORTED  `needed` is true and the file does not determine it
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_options_hilum(const supine_basis *basis, const supine_pose *pose,
                                   const supine_pose *from, bool needed, double shift[3],
                                   supine_error *error);

/* Print the displacement of the hilum in one line, and whether it was subtracted. */
void supine_options_hilum_print(const double shift[3], bool subtracted);

#define SUPINE_EXPECTED_MEANING                                                                    \
  "3-D RMS; half of all points lie within 0.9 times this distance of their true position, 95 % "   \
  "within 1.8 times"
#define SUPINE_EXPECTED_SUPPORT                                                                    \
  "The expected error was measured on breaths in one posture; for a change of posture it is an "   \
  "extrapolation. 'supine info' lists its terms."

/* Expected errors of the displacements from one state to another. Initialise with zeros, and
 * release with supine_options_expected_free. */
typedef struct supine_expected {
  float *sigma;        /* expected error of each vertex's displacement, mm; NULL if unknown */
  double rms, largest; /* RMS and maximum of `sigma` over the vertices, mm */
  bool turned;         /* whether the displacements include a change of posture */
} supine_expected;

/* Compute the expected errors of the displacements from one state to another. They are unknown for
 * open surfaces and for displacements computed by another simulator; `expected` is then unchanged.
 * @retval SUPINE_ERROR_MEMORY, or any status of supine_basis_pose */
supine_status supine_options_expected_find(const supine_basis *basis, const supine_state *state,
                                           const supine_state *from, supine_expected *expected,
                                           supine_error *error);
void supine_options_expected_free(supine_expected *expected);

/* Print the RMS and the largest expected error in one line; if unknown, print nothing. */
void supine_options_expected_print(const supine_expected *expected, FILE *file);

#endif
