/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Vertices of the reference surface matched to nearest points of the surface in another state:
 * the data of a fit to surfaces. */
#ifndef SUPINE_PATIENT_MATCHING_H
#define SUPINE_PATIENT_MATCHING_H

#include "precompute/inside/surface.h"
#include "precompute/patient/rows.h"
#include "precompute/physics/model.h"

typedef struct supine_patient_matching {
  const supine_lungs *rest;
  const supine_mesh *state;
  supine_patient_frame frame;
  supine_inside_surface *tree;
  supine_equilibrium *equilibrium;
  double *columns;              /* [N, COLUMNS] of the force before spreading */
  double *caught;               /* [N, COLUMNS] of the force after spreading */
  double *rest_normals;         /* [N, 3], unit */
  double *state_normals;        /* [state vertices, 3], unit */
  size_t count;                 /* vertices that take part */
  size_t *vertex;               /* [count] indices in the reference surface */
  double *moved;                /* [count, 3] moved by the law */
  supine_patient_row *rows;     /* [count + 3 landmarks] */
  double *distance;             /* [count] along the normal, mm */
  supine_inside_place *nearest; /* [count] */
  double *space;                /* [count] */
  bool warm;                    /* nearest holds first guesses */
  size_t landmark_rows_count;
} supine_patient_matching;

/* Set up the force's columns and `most` vertices of the reference surface, with room for the rows
 * of the landmarks. Zero-initialise before; free even after a failure.
 * @retval SUPINE_ERROR_MEMORY, those of the solve */
supine_status supine_patient_matching_create(const supine_lungs *rest, const supine_mesh *state,
                                             const supine_model *model, size_t most,
                                             size_t landmarks, supine_patient_matching *matching,
                                             supine_error *error);
void supine_patient_matching_free(supine_patient_matching *matching);

/* Let other vertices take part, at most `most`, spread evenly; all rows are new.
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_patient_matching_choose(supine_patient_matching *matching, size_t most,
                                             size_t landmarks, supine_error *error);

/* Spread the force's columns under a stiffness [N] (NULL: 1), into caught and the rows.
 * @retval as the solve */
supine_status supine_patient_matching_solve(supine_patient_matching *matching,
                                            const double *stiffness, supine_error *error);

/* Append the landmarks' rows, with the same total weight as the surface's rows. */
void supine_patient_matching_append(supine_patient_matching *matching,
                                    const supine_patient_pairs *landmarks);

/* Move the vertices by the law at their rows, with a correction, and return the RMS change of
 * their positions, mm. */
double supine_patient_matching_place(supine_patient_matching *matching,
                                     const supine_patient *patient);

/* Set row i to the tangent plane of the other surface at the point nearest to the moved vertex
 * i; weight 1, or 0 if the normals are incompatible. */
void supine_patient_matching_find(supine_patient_matching *matching);

/* Weight the rows by Tukey's biweight, which is 0 beyond 4.7 times a robust scale of the
 * distances. Find the share of vertices with weight and the weighted RMS distance.
 * @param scale  least scale, mm; INFINITY: keep the weights */
double supine_patient_matching_weigh(supine_patient_matching *matching, double scale, double *rms);

#endif
