/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Match vertices of the reference surface to the nearest points of the surface in another state, as
 * the data of a fit to surfaces. */
#ifndef SUPINE_PATIENT_MATCHING_H
#define SUPINE_PATIENT_MATCHING_H

#include "precompute/inside/surface.h"
#include "precompute/patient/patient_file.h"
#include "precompute/physics/model.h"

/* A vertex of the reference surface that takes part, and its match on the other surface. */
typedef struct supine_patient_match {
  size_t vertex;               /* index in the reference surface */
  double moved[3];             /* position after the displacement by the law, mm */
  double distance;             /* from there to the other surface along its normal, mm */
  supine_inside_place nearest; /* nearest point of the other surface */
} supine_patient_match;

typedef struct supine_patient_matching {
  const supine_lungs *rest; /* the reference surface */
  const supine_mesh *state; /* the surface in the other state */
  supine_patient_frame frame;
  supine_inside_surface *tree;
  supine_equilibrium *equilibrium;
  double *columns;               /* [N, COLUMNS] columns of the force before spreading */
  double *spread;                /* [N, COLUMNS] columns of the force after spreading */
  double *rest_normals;          /* [N, 3] unit normals of the reference surface */
  double *state_normals;         /* [state vertices, 3] unit normals of the other surface */
  size_t count;                  /* number of vertices that take part */
  supine_patient_match *match;   /* [count] */
  supine_patient_row *rows;      /* [count + landmark_row_count] */
  double *space;                 /* [count] working space */
  double matched;                /* share of the vertices with a compatible normal at the match */
  double rms;                    /* weighted RMS of the matches' distances, mm */
  const supine_patient *patient; /* law that moved the vertices last */
  size_t landmark_row_count;     /* three rows for each landmark */
} supine_patient_matching;

/* Spread the columns of the force and choose at most `most` vertices of the reference surface;
 * allocate rows for them and for a number of landmarks. Free the matching even after a failure.
 * @retval SUPINE_ERROR_MEMORY, those of the solve */
supine_status supine_patient_matching_create(const supine_lungs *rest, const supine_mesh *state,
                                             const supine_patient_stiffness *stiffness, size_t most,
                                             size_t landmarks, supine_patient_matching *matching,
                                             supine_error *error);
void supine_patient_matching_free(supine_patient_matching *matching);

/* Choose the vertices that take part, at most `most` at even steps of the index, and initialise
 * their matches and rows. The rows of landmarks are dropped. */
void supine_patient_matching_choose(supine_patient_matching *matching, size_t most);

/* Spread the columns of the force under a stiffness; write them to `spread` and the rows.
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

/* Weight the rows by Tukey's biweight, which is 0 beyond 4.7 times a robust scale of the distances,
 * and find the matched share and the RMS distance.
 * @param scale  least scale, mm; INFINITY: keep the weights
 * @retval SUPINE_ERROR_MESH  less than 30 % of the vertices match */
supine_status supine_patient_matching_weigh(supine_patient_matching *matching, double scale,
                                            supine_error *error);

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
