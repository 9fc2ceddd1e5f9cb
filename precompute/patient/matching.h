/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Match vertices of the reference surface to the surface of the lungs in another state. */
#ifndef SUPINE_PATIENT_MATCHING_H
#define SUPINE_PATIENT_MATCHING_H

#include "precompute/lungs/surface.h"
#include "precompute/patient/patient_file.h"
#include "precompute/physics/model.h"

/* A vertex of the surface in one state of the lungs, and its match on the surface in another. */
typedef struct supine_patient_match {
  size_t vertex;               /* index in the undisplaced surface */
  double position[3];          /* position of the displaced vertex, mm */
  double distance;             /* from `position` to `nearest`, along the normal at `nearest`, mm */
  supine_inside_place nearest; /* point of the other surface nearest to `position` */
} supine_patient_match;

typedef struct supine_patient_matching {
  const supine_lungs *fuller; /* surface of the lungs in the fuller state, to be displaced */
  const supine_mesh *state;   /* surface of the same lungs in another state, to be matched */
  supine_patient_frame frame;
  supine_lungs_surface *tree;
  supine_equilibrium *equilibrium;
  /* [vertices, 4] 1, X - 1/2, Y - 1/2 and Z - 1/2, smoothed over the surface; X, Y and Z are
   * coordinates 0 to 1 in the lungs' bounding box */
  double *smoothed_force;
  double *tissue; /* [vertices, 3] displacement minus that of uniform tissue, mm; NULL if uniform */
  double *fuller_normals;      /* [fuller->mesh.vertex_count, 3] unit normals of `fuller` */
  double *state_normals;       /* [state->vertex_count, 3] unit normals */
  size_t count;                /* number of vertices to match, spread over `fuller` */
  supine_patient_match *match; /* [count] these vertices and their matches */
  supine_patient_row *rows;    /* [count + landmark_row_count] measurements */
  double *space;               /* [count] temporary values, one for each match */
  supine_arena arena;          /* holds the arrays above */
  double matched; /* share of vertices whose normal is like that at match->nearest, 0 to 1 */
  double rms;     /* weighted RMS of match->distance, mm */
  const supine_patient *patient; /* displacement law that last displaced the vertices */
  size_t landmark_row_count;     /* number of measurements of landmarks, three for each landmark */
} supine_patient_matching;

/* Prepare the matching of surface `fuller` to surface `state`: compute smoothed_force, and choose
 * at most `limit` vertices to match. Allocate one measurement per vertex and three per landmark.
 * Call supine_patient_matching_free also after a failure. */
supine_status supine_patient_matching_create(const supine_lungs *fuller, const supine_mesh *state,
                                             size_t limit, size_t landmarks,
                                             supine_patient_matching *matching,
                                             supine_error *error);
void supine_patient_matching_free(supine_patient_matching *matching);

/* Choose at most `limit` vertices with evenly spaced indices, and initialise their matches and
 * measurements. Measurements of landmarks are dropped. */
void supine_patient_matching_choose(supine_patient_matching *matching, size_t limit);

/* Compute matching->tissue for displacements of uniform tissue by `law`. */
supine_status supine_patient_matching_set_tissue(supine_patient_matching *matching,
                                                 const supine_patient_power *law,
                                                 const supine_patient_stiffness *stiffness,
                                                 supine_error *error);

/* Displace the vertices to match by a displacement law and matching->tissue. Return the RMS change
 * of position, mm. */
double supine_patient_matching_place(supine_patient_matching *matching,
                                     const supine_patient *patient);

/* Match each displaced vertex to the nearest point of the surface matching->state. Set the vertex's
 * measurement to the distance from its undisplaced position to this point, along the point's
 * normal. Set its weight to 1, or to 0 if the normals of the two differ by more than 60 degrees. */
void supine_patient_matching_find(supine_patient_matching *matching);

/* Multiply the weights of the vertices' measurements by Tukey's biweight of match->distance, which
 * is 0 beyond 4.7 times a robust scale (standard deviation) of all distances. Compute
 * matching->matched and matching->rms.
 * @param scale  lower bound on the robust scale, mm; INFINITY keeps the weights as they are */
supine_status supine_patient_matching_weigh(supine_patient_matching *matching, double scale,
                                            supine_error *error);

/** Write each region's share in the tissue at a vertex, 0 to 1, into shares [stiffness->count]. */
void supine_patient_stiffness_shares(const supine_patient_stiffness *stiffness,
                                     const supine_lungs *lungs, size_t vertex, double *shares);

/** Write the relative stiffness of the tissue at every vertex into e [vertices]. */
void supine_patient_stiffness_of(const supine_patient_stiffness *stiffness,
                                 const supine_lungs *lungs, double *e);

/** Write the expandability of every vertex, and how far surfaces determine it, to a
 * CSV file or as point data of a surface file. */
supine_status supine_patient_stiffness_write(const char *path,
                                             const supine_patient_stiffness *stiffness,
                                             const supine_lungs *lungs, supine_error *error);

/** Find the expandability a (1 / stiffness) of each lung region from the displacement between the
 * surfaces of two states ([Santhanam2008] VI).
 *
 * Surfaces show the motion along the normal n. By strain.h, n.u is linear in the expandabilities
 * a_k of the regions:
 *
 *     n.u = n.(u_0 + sum over k of a_k u_k)
 *
 * u_k is the displacement if only region k expands, with a_k = 1, and the rest moves with it. The
 * displacement of uniform tissue is that of the default law, with a factor for each axis. These
 * factors, the motion of the body and the a_k are found by least squares. The prior expects every
 * a_k to be near 1 and similar in neighbouring regions. After each step, the surfaces are matched
 * again. The result is kept only if it reduces the held-out error.
 * @param matching   without landmarks, matched by the law of uniform tissue; its `tissue` is set
 * @param patient    in: `frame`, the bounding box of the lungs; out: the fitted displacement law if
 *   the result is kept
 * @param stiffness  written; uniform (no regions) if the fitted regions do not reduce the error */
supine_status supine_patient_expand(supine_patient_matching *matching,
                                    const supine_patient_fit_options *options,
                                    supine_patient *patient, supine_patient_stiffness *stiffness,
                                    supine_patient_expand_report *report, supine_error *error);

/** Compute the force on each vertex that would cause the displacement between the two surfaces.
 * Average it in cubes of 40 mm, and fit a linear function of the coordinates in the lungs' bounding
 * box to the means.
 * @param matching  on return all vertices are matched
 * @param patient   displacement law fitted to these surfaces; its kriging correction is not used
 * @param gravity   unit vector in the emptier state */
supine_status supine_patient_applied_find(supine_patient_matching *matching,
                                          const supine_patient *patient, const double gravity[3],
                                          supine_patient_applied *applied, supine_error *error);

/** Compute the force from landmarks instead, F = u.d / |d|^2 without a smoothing, as the law's d is
 * the displacement of tissue inside the lungs too. If they do not determine the linear function, as
 * when they lie in four cubes or fewer, leave `applied` as it is.
 * @param rows  [3 count] measurements of each landmark along x, y and z; their `block` is changed
 */
supine_status supine_patient_applied_find_landmarks(supine_patient_row *rows, size_t count,
                                                    const supine_patient *patient,
                                                    const double gravity[3],
                                                    supine_patient_applied *applied,
                                                    supine_error *error);

#endif
