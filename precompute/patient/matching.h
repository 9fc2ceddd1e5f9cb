/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Match vertices of the reference surface to the surface of the lungs in another state. */
#ifndef SUPINE_PATIENT_MATCHING_H
#define SUPINE_PATIENT_MATCHING_H

#include "precompute/inside/surface.h"
#include "precompute/patient/patient_file.h"
#include "precompute/physics/model.h"

/* A chosen vertex of the reference surface and its match on the other surface. */
typedef struct supine_patient_match {
  size_t vertex;      /* index in the reference surface */
  double position[3]; /* position after the latest displacement, mm */
  double distance;    /* from `position` to `nearest`, along the other surface's normal, mm */
  supine_inside_place nearest; /* nearest point of the other surface */
} supine_patient_match;

typedef struct supine_patient_matching {
  const supine_lungs *rest; /* the reference surface */
  const supine_mesh *state; /* the surface in the other state */
  supine_patient_frame frame;
  supine_inside_surface *tree;
  supine_equilibrium *equilibrium;
  double *spread;                /* [N, 4] terms of the force after spreading, at N vertices */
  double *rest_normals;          /* [rest->mesh.vertex_count, 3] unit vectors */
  double *state_normals;         /* [state->vertex_count, 3] unit vectors */
  size_t count;                  /* number of chosen vertices */
  supine_patient_match *match;   /* [count] chosen vertices and their matches */
  supine_patient_row *rows;      /* [count + landmark_row_count] rows to fit */
  double *space;                 /* [count] work space */
  double matched;                /* share of vertices whose nearest point faces the same way */
  double rms;                    /* weighted RMS of match->distance, mm */
  const supine_patient *patient; /* displacement law that last displaced the vertices */
  size_t landmark_row_count;     /* number of rows, three for each landmark */
} supine_patient_matching;

/* Spread the terms of the force over the surface `rest`, choose at most `limit` vertices of it, and
 * allocate rows for these vertices and for `landmarks` landmarks. Call supine_patient_matching_free
 * also after a failure.
 * @retval SUPINE_ERROR_MEMORY, those of supine_physics_equilibrium_solve */
supine_status supine_patient_matching_create(const supine_lungs *rest, const supine_mesh *state,
                                             const supine_patient_stiffness *stiffness,
                                             size_t limit, size_t landmarks,
                                             supine_patient_matching *matching,
                                             supine_error *error);
void supine_patient_matching_free(supine_patient_matching *matching);

/* Choose at most `limit` vertices with evenly spaced indices, and initialise their matches and
 * rows. Rows of landmarks are dropped. */
void supine_patient_matching_choose(supine_patient_matching *matching, size_t limit);

/* Spread the terms of the force through tissue of the given stiffness, and write them into
 * matching->spread and the rows.
 * @retval SUPINE_ERROR_MEMORY, those of supine_physics_equilibrium_solve */
supine_status supine_patient_matching_solve(supine_patient_matching *matching,
                                            const supine_patient_stiffness *stiffness,
                                            supine_error *error);

/* Displace the chosen vertices by a displacement law. Return the RMS distance moved, mm. */
double supine_patient_matching_place(supine_patient_matching *matching,
                                     const supine_patient *patient);

/* Match each displaced vertex to the nearest point of the other surface. The vertex's row becomes
 * the displacement to that point along the normal there. The row's weight is 1, or 0 if the normals
 * of the vertex and the point differ by more than 60 degrees. */
void supine_patient_matching_find(supine_patient_matching *matching);

/* Weight the rows by Tukey's biweight, which is 0 beyond 4.7 times a robust scale of the distances.
 * Compute matching->matched and matching->rms.
 * @param scale  lower bound on the robust scale, mm; INFINITY keeps the weights as they are
 * @retval SUPINE_ERROR_MESH  less than 30 % of the vertices match */
supine_status supine_patient_matching_weigh(supine_patient_matching *matching, double scale,
                                            supine_error *error);

/** Write each region's weight at a vertex into shares [stiffness->count]; the weights sum to 1. */
void supine_patient_stiffness_shares(const supine_patient_stiffness *stiffness,
                                     const supine_lungs *lungs, size_t vertex, double *shares);

/** Write the relative stiffness at every vertex into e [vertices]. */
void supine_patient_stiffness_of(const supine_patient_stiffness *stiffness,
                                 const supine_lungs *lungs, double *e);

/** Find the expandability a of each region of the lungs from the displacement between two surfaces
 * ([Santhanam2008] VI).
 *
 * The displacement depends only on the product a f of expandability and force, so f is set to the
 * force of the default law (deep). The spread force F (equilibrium.h) is then linear in the
 * expandabilities a_k of the regions: F = sum over k of a_k F_k, where F_k is the spread force if
 * only region k has force and its expandability is 1. The a_k are fitted together with the
 * constants of the paper's law and the motion between the scans (krige.h), under a prior that a is
 * near 1 and similar in neighbouring regions. After each fit, the surfaces are matched again.
 *
 * The regions are kept only if they reduce the error on held-out blocks of 40 mm.
 * @param matching   without landmarks; on return, its force is spread with the fitted stiffness
 * @param options    the paper's law, and gravity in the other state
 * @param patient    in: the frame; out: the fitted law
 * @param stiffness  written; without regions if they are not kept
 * @retval SUPINE_ERROR_NUMERICAL, SUPINE_ERROR_MEMORY */
supine_status supine_patient_expand(supine_patient_matching *matching,
                                    const supine_patient_fit_options *options,
                                    supine_patient *patient, supine_patient_stiffness *stiffness,
                                    supine_patient_expand_report *report, supine_error *error);

/** Compute the applied force that the displacement to the other surface implies, average it over
 * blocks, and fit its slopes along X, Y and Z (c7 to c9).
 * @param matching  created with the patient's stiffness; on return all vertices are matched
 * @param patient   law fitted to the matching; its correction is not used
 * @param gravity   unit vector in the other state
 * @retval SUPINE_ERROR_NUMERICAL  the blocks do not determine the slopes
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_patient_applied_find(supine_patient_matching *matching,
                                          const supine_patient *patient, const double gravity[3],
                                          supine_patient_applied *applied, supine_error *error);

#endif
