/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Match vertices of the reference surface to the surface of the lungs in another state. */
#ifndef SUPINE_PATIENT_MATCHING_H
#define SUPINE_PATIENT_MATCHING_H

#include "precompute/inside/surface.h"
#include "precompute/patient/patient_file.h"
#include "precompute/physics/model.h"

/* A chosen vertex of the reference surface, and its match on the surface in another state. */
typedef struct supine_patient_match {
  size_t vertex;               /* index in the reference surface */
  double position[3];          /* position of the displaced vertex, mm */
  double distance;             /* from `position` to `nearest`, along the normal at `nearest`, mm */
  supine_inside_place nearest; /* nearest point of the surface in another state */
} supine_patient_match;

typedef struct supine_patient_matching {
  const supine_lungs *rest; /* the reference surface */
  const supine_mesh *state; /* surface of the same lungs in another state */
  supine_patient_frame frame;
  supine_inside_surface *tree;
  supine_equilibrium *equilibrium;
  double *smoothed_force;      /* [N, 4] terms of the force, smoothed over the surface */
  double *rest_normals;        /* [rest->mesh.vertex_count, 3] unit normals of the vertices */
  double *state_normals;       /* [state->vertex_count, 3] unit normals of the vertices */
  size_t count;                /* number of chosen vertices */
  supine_patient_match *match; /* [count] chosen vertices and their matches */
  supine_patient_row *rows;    /* [count + landmark_row_count] measurements */
  double *space;               /* [count] temporary values, one for each chosen vertex */
  double matched; /* share of the chosen vertices with a similar normal at the nearest point */
  double rms;     /* weighted RMS of match->distance, mm */
  const supine_patient *patient; /* displacement law that last displaced the vertices */
  size_t landmark_row_count;     /* number of measurements of landmarks, three for each landmark */
} supine_patient_matching;

/* Prepare the matching of the surface `rest` to `state`: smooth the terms of the force over `rest`,
 * choose at most `limit` vertices of it, and allocate one measurement for each of these and three
 * for each of `landmarks` landmarks. Call supine_patient_matching_free also after a failure.
 * @retval SUPINE_ERROR_MEMORY, those of supine_physics_equilibrium_solve */
supine_status supine_patient_matching_create(const supine_lungs *rest, const supine_mesh *state,
                                             const supine_patient_stiffness *stiffness,
                                             size_t limit, size_t landmarks,
                                             supine_patient_matching *matching,
                                             supine_error *error);
void supine_patient_matching_free(supine_patient_matching *matching);

/* Choose at most `limit` vertices with evenly spaced indices, and initialise their matches and
 * measurements. Measurements of landmarks are dropped. */
void supine_patient_matching_choose(supine_patient_matching *matching, size_t limit);

/* Smooth the terms of the force over the surface by solving the equilibrium (equilibrium.h) with
 * the given stiffness. Write them into matching->smoothed_force and the vertices' measurements.
 * @retval SUPINE_ERROR_MEMORY, those of supine_physics_equilibrium_solve */
supine_status supine_patient_matching_solve(supine_patient_matching *matching,
                                            const supine_patient_stiffness *stiffness,
                                            supine_error *error);

/* Displace the chosen vertices by a displacement law. Return the RMS change of position, mm. */
double supine_patient_matching_place(supine_patient_matching *matching,
                                     const supine_patient *patient);

/* Match each displaced vertex to the nearest point of the surface matching->state. The vertex's
 * measurement becomes the displacement to that point along the normal there; its weight becomes 1,
 * or 0 if the normals of vertex and point differ by more than 60 degrees. */
void supine_patient_matching_find(supine_patient_matching *matching);

/* Multiply the weights of the vertices' measurements by Tukey's biweight of match->distance, which
 * is 0 beyond 4.7 times a robust scale (standard deviation) of all distances. Compute
 * matching->matched and matching->rms.
 * @param scale  lower bound on the robust scale, mm; INFINITY keeps the weights as they are
 * @retval SUPINE_ERROR_MESH  less than 30 % of the vertices match */
supine_status supine_patient_matching_weigh(supine_patient_matching *matching, double scale,
                                            supine_error *error);

/** Write each region's share in the tissue at a vertex, 0 to 1, into shares [stiffness->count]. */
void supine_patient_stiffness_shares(const supine_patient_stiffness *stiffness,
                                     const supine_lungs *lungs, size_t vertex, double *shares);

/** Write the relative stiffness of the tissue at every vertex into e [vertices]. */
void supine_patient_stiffness_of(const supine_patient_stiffness *stiffness,
                                 const supine_lungs *lungs, double *e);

/** Find the expandability a (1 / stiffness) of each lung region from the displacement between two
 * surfaces ([Santhanam2008] VI).
 *
 * The displacement depends only on the product of a and the force f, so f is set to the force of
 * the default displacement law. Smoothed over the surface (equilibrium.h), a f becomes F, which is
 * linear in the expandabilities a_k of the regions:
 *
 *     F = sum over k of a_k F_k
 *
 * F_k is F for a_k = 1 if all other regions have no force. The a_k are fitted together with the
 * nine constants of the displacement law and the motion of the body between the scans (krige.h).
 * Their prior: a_k is near 1 and similar in neighbouring regions. After each fit, the surfaces are
 * matched again. The regions are kept only if they reduce the error on held-out cubes of 40 mm.
 * @param matching   without landmarks; on return, smoothed_force uses the fitted stiffness
 * @param options    with SUPINE_PATIENT_PAPER, and gravity in the emptier state
 * @param patient    in: the frame; out: the fitted displacement law
 * @param stiffness  written; without regions if they are not kept
 * @retval SUPINE_ERROR_NUMERICAL, SUPINE_ERROR_MEMORY */
supine_status supine_patient_expand(supine_patient_matching *matching,
                                    const supine_patient_fit_options *options,
                                    supine_patient *patient, supine_patient_stiffness *stiffness,
                                    supine_patient_expand_report *report, supine_error *error);

/** Compute the applied force that the displacement between the two surfaces implies, average it
 * over the vertices in each cube of 40 mm, and fit how it changes with the box coordinates X, Y and
 * Z.
 * @param matching  created with the patient's stiffness; on return all vertices are matched
 * @param patient   displacement law fitted to the matching; its correction is not used
 * @param gravity   unit vector in the emptier state
 * @retval SUPINE_ERROR_NUMERICAL  the means do not determine how the force changes
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_patient_applied_find(supine_patient_matching *matching,
                                          const supine_patient *patient, const double gravity[3],
                                          supine_patient_applied *applied, supine_error *error);

#endif
