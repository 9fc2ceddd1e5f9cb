/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Vertices of a surface at rest, and where the surface in another state is nearest to them: what
 * fits to surfaces are made of. */
#ifndef SUPINE_PATIENT_MATCHING_H
#define SUPINE_PATIENT_MATCHING_H

#include "precompute/inside/surface.h"
#include "precompute/patient/rows.h"
#include "precompute/physics/model.h"

enum { SUPINE_PATIENT_COLUMNS = 4 }; /* of the force: 1, X - 1/2, Y - 1/2, Z - 1/2 */

typedef struct supine_patient_matching {
  const supine_lungs *rest;
  const supine_mesh *state;
  supine_patient_frame frame;
  supine_inside_surface *tree;
  supine_network *network;
  supine_equilibrium *equilibrium; /* of SUPINE_PATIENT_COLUMNS */
  double *columns;                 /* [N, SUPINE_PATIENT_COLUMNS] the force */
  double *caught;                  /* [N, SUPINE_PATIENT_COLUMNS] what it comes to */
  double *state_normals;           /* [state vertices, 3], unit */
  size_t count;                    /* vertices that take part */
  size_t *vertex;                  /* [count] of rest */
  double *normals;                 /* [count, 3] at rest */
  double *moved;                   /* [count, 3] where the law puts them */
  supine_patient_row *rows;        /* [count + 3 landmarks] */
  double *distance;                /* [count] along the normal */
  supine_inside_place *nearest;    /* [count] */
  double *space;                   /* [count] */
  bool warm;                       /* nearest holds places near by */
  size_t landmark_rows_count;
} supine_patient_matching;

/* Sets up the vertices, at rest, with room for the rows of so many landmarks. Zeroed before; free
 * it even after a failure.
 * @param most  vertices at most that take part
 * @retval SUPINE_ERROR_MEMORY, those of the solve */
supine_status supine_patient_matching_create(const supine_lungs *rest, const supine_mesh *state,
                                             const supine_model *model, size_t most,
                                             size_t landmarks, supine_patient_matching *matching,
                                             supine_error *error);
void supine_patient_matching_free(supine_patient_matching *matching);

/* What the force's columns come to under a stiffness [N] (NULL: 1), into caught and the rows.
 * @retval those of the solve */
supine_status supine_patient_matching_solve(supine_patient_matching *matching,
                                            const double *stiffness, supine_error *error);

/* Landmarks after the surface's rows, all together as heavy as those. */
void supine_patient_matching_append(supine_patient_matching *matching,
                                    const supine_patient_pairs *landmarks);

/* Row i becomes the plane of the state's surface nearest to where vertex i is; its weight 1, or 0
 * where the normals there point different ways. */
void supine_patient_matching_find(supine_patient_matching *matching);

/* Weights fall to 0 at 4.7 times what most distances are, or the scale given where that is more
 * (Tukey's biweight). The share of vertices that had any weight, and the weighted RMS distance.
 * @param scale  mm, at least; INFINITY: weights stay */
double supine_patient_matching_weigh(supine_patient_matching *matching, double scale, double *rms);

#endif
