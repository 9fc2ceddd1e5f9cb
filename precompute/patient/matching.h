/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Match vertices of the reference surface to the nearest points of the surface in another state, as
 * the data of a fit to surfaces. */
#ifndef SUPINE_PATIENT_MATCHING_H
#define SUPINE_PATIENT_MATCHING_H

#include "precompute/inside/surface.h"
#include "precompute/patient/patient_file.h"
#include "precompute/physics/model.h"

typedef struct supine_patient_matching {
  const supine_lungs *rest; /* the reference surface */
  const supine_mesh *state; /* the surface in the other state */
  supine_patient_frame frame;
  supine_inside_surface *tree;
  supine_equilibrium *equilibrium;
  double *columns;               /* [N, COLUMNS] of the force before spreading */
  double *caught;                /* [N, COLUMNS] of the force after spreading */
  double *rest_normals;          /* [N, 3], unit */
  double *state_normals;         /* [state vertices, 3], unit */
  size_t count;                  /* vertices that take part */
  size_t *vertex;                /* [count] indices in the reference surface */
  double *moved;                 /* [count, 3] positions after the law, mm */
  supine_patient_row *rows;      /* [count + 3 landmarks] */
  double *distance;              /* [count] from the moved vertex along the normal, mm */
  supine_inside_place *nearest;  /* [count] places of the moved vertices */
  double *space;                 /* [count] working space */
  const supine_patient *patient; /* law that the vertices were moved by last */
  bool warm;                     /* nearest holds first guesses */
  size_t landmark_rows_count;
} supine_patient_matching;

/* Set up the force's columns and at most `most` vertices of the reference surface, with room for
 * the rows of the landmarks. Zero-initialise before; free even after a failure.
 * @retval SUPINE_ERROR_MEMORY, those of the solve */
supine_status supine_patient_matching_create(const supine_lungs *rest, const supine_mesh *state,
                                             const supine_patient_stiffness *stiffness, size_t most,
                                             size_t landmarks, supine_patient_matching *matching,
                                             supine_error *error);
void supine_patient_matching_free(supine_patient_matching *matching);

/* Choose the vertices that take part, at most `most` at even steps of the index, and make their
 * rows anew, with room for three rows of each landmark.
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_patient_matching_choose(supine_patient_matching *matching, size_t most,
                                             size_t landmarks, supine_error *error);

/* Spread the force's columns under a stiffness; write them to `caught` and the rows.
 * @retval SUPINE_ERROR_MEMORY, those of the solve */
supine_status supine_patient_matching_solve(supine_patient_matching *matching,
                                            const supine_patient_stiffness *stiffness,
                                            supine_error *error);

/* Move the vertices by the law at their rows, with a correction, and return the RMS change of
 * their positions, mm. */
double supine_patient_matching_place(supine_patient_matching *matching,
                                     const supine_patient *patient);

/* Set row i to the tangent plane of the other surface at its point nearest to the moved vertex i;
 * weight 1, or 0 if the normals are incompatible. */
void supine_patient_matching_find(supine_patient_matching *matching);

/* Weight the rows by Tukey's biweight, which is 0 beyond 4.7 times a robust scale of the
 * distances. Return the share of vertices that had weight before.
 * @param scale  least scale, mm; INFINITY: keep the weights
 * @param rms    written: weighted RMS distance, mm */
double supine_patient_matching_weigh(supine_patient_matching *matching, double scale, double *rms);

/** Find the weights [count] of the regions at a vertex; they sum to 1. */
void supine_patient_stiffness_shares(const supine_patient_stiffness *stiffness,
                                     const supine_lungs *lungs, size_t vertex, double *shares);

/** Compute the relative stiffness E [N] of every vertex. */
void supine_patient_stiffness_of(const supine_patient_stiffness *stiffness,
                                 const supine_lungs *lungs, double *e);

/** Find the expandability from motion ([Santhanam2008] VI): a stiffness for each region of a lung,
 * such that a known force moves it to the other surface.
 *
 * The motion depends only on the product a f of expandability and force, so f is fixed to
 * that of the law deep. The spread force F is then linear in the regions' values a_k, F = sum of
 * a_k F_k, where F_k is the spread force of region k alone: one solve with a right-hand side for
 * each region. The values are fitted together with the constants of the paper law and the motion
 * between the scans (krige.h), with a prior that keeps neighbours alike and a near 1; fit and
 * nearest points alternate. Where the surfaces say little about a region, its neighbours determine
 * it.
 *
 * The result is kept only if it predicts held-out blocks of 40 mm better than uniform tissue
 * does under the same force.
 * @param matching   without landmarks; its force is spread by the stiffness afterwards
 * @param options    of the paper's law; the gravity of the other state
 * @param patient    its frame is set; overwritten
 * @param stiffness  no regions if it was not kept
 * @retval SUPINE_ERROR_NUMERICAL, SUPINE_ERROR_MEMORY */
supine_status supine_patient_expand(supine_patient_matching *matching,
                                    const supine_patient_fit_options *options,
                                    supine_patient *patient, supine_patient_stiffness *stiffness,
                                    supine_patient_expand_report *report, supine_error *error);

/** Find the force that the displacement to the other surface implies, averaged over blocks, and fit
 * (18) to it.
 * @param matching  solved with the stiffness; afterwards it holds every vertex
 * @param patient   the law fitted to the matching; its correction is not used
 * @param gravity   of the other state
 * @retval SUPINE_ERROR_NUMERICAL  the blocks do not determine (18)
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_patient_applied_find(supine_patient_matching *matching,
                                          const supine_patient *patient, const double gravity[3],
                                          supine_patient_applied *applied, supine_error *error);

#endif
