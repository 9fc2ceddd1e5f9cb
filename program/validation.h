/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Predict states of a person by a basis and compare them with scans, for 'supine validate'. */
#ifndef SUPINE_COMMAND_VALIDATION_H
#define SUPINE_COMMAND_VALIDATION_H

#include "precompute/patient/krige.h"
#include "precompute/source.h"
#include "program/options/state_options.h"

enum { SUPINE_COMMAND_STATES_MAX = 8 };

/* A state as the command line names it. */
typedef struct supine_command_state {
  const char *path;                      /* its surface; NULL: landmarks only */
  char posture[SUPINE_POSTURE_NAME_MAX]; /* empty: not given */
  supine_state state;                    /* default volume: not given */
} supine_command_state;

/* "predicted", "none", "translation", "affine". */
extern const char *const supine_command_map_names[SUPINE_PATIENT_MAP_COUNT];

/* Distances, mm. */
typedef struct supine_command_distance {
  double mean, rms, p95;
  double largest;   /* of surfaces: Hausdorff distance */
  double explained; /* explained share of the squared distance without a map, or of that after a
                         translation if motion between the scans is removed; NAN if nothing moved */
} supine_command_distance;

/* Result for one state. */
typedef struct supine_command_outcome {
  supine_pose pose;
  double scale;       /* its gain */
  double millilitres; /* mL above the state that motion starts from */
  double *predicted;  /* [N, 3] */
  double *nearest;    /* [N, 3] nearest points of the state's surface */
  bool has_surface, has_points, has_best;
  supine_command_distance surface[SUPINE_PATIENT_MAP_COUNT];
  supine_command_distance points[SUPINE_PATIENT_MAP_COUNT];
  double best_scale; /* scale with the least distance to the surface */
  double best_rms;   /* that distance, RMS over vertices, mm */
} supine_command_outcome;

typedef struct supine_command_subject {
  supine_basis *basis;
  supine_patient_scan_motion moved; /* motion between the scans that is removed */
  supine_command_state from;
  double from_scale, from_millilitres; /* gain and volume of the state that motion starts from */
  supine_mesh rest;                    /* surface that motion starts from */
  size_t count;
  supine_command_state state[SUPINE_COMMAND_STATES_MAX];
  supine_command_outcome outcome[SUPINE_COMMAND_STATES_MAX];
  size_t line_count; /* states in the posture of the first, which the line is fitted to */
  double line_slope; /* breath scale per mL */
  double line_off;   /* largest residual, as a share of the largest scale */
} supine_command_subject;

void supine_command_subject_free(supine_command_subject *subject);

/* Open a basis and compute the surface that motion starts from: that of the state `from`, or the
 * scan's where `from` names no posture.
 * @retval those of the run-time library */
supine_status supine_command_subject_open(const char *path, supine_command_subject *subject,
                                          supine_error *error);

/* Predict state i, and compare it with its surface and with landmarks (NULL: none).
 * @param reverse  of the landmarks
 * @retval those of loading and comparing */
supine_status supine_command_validate_state(supine_command_subject *subject, size_t i,
                                            const supine_source_options *source,
                                            const char *landmarks, bool reverse,
                                            supine_error *error);

/* Fit to the best scales over volumes a line through the state that motion starts from. */
void supine_command_find_line(supine_command_subject *subject);

/* Draw the errors on the surface, one panel for each state.
 * @retval SUPINE_ERROR_UNSUPPORTED, SUPINE_ERROR_WRITE, ... of rendering */
supine_status supine_command_draw_errors(const supine_command_subject *subject, const char *path,
                                         supine_error *error);

/* Compute distances of points that are known in both states.
 * @param moved      motion between the scans that is taken out of the prediction, by least squares
 * @param predicted  [count, 3] where the pairs' first points were predicted to go
 * @retval SUPINE_ERROR_NUMERICAL (all in one plane), SUPINE_ERROR_MEMORY */
supine_status supine_command_compare_points(
    const supine_patient_pairs *pairs, const double *predicted, supine_patient_scan_motion moved,
    supine_command_distance distance[SUPINE_PATIENT_MAP_COUNT], supine_error *error);

/* Compute distances between surfaces of any meshing, of the vertices of each to the other surface.
 * The maps are fitted by iterated nearest points.
 * @param rest       the surface that motion starts from
 * @param moved      motion between the scans that is taken out of the prediction
 * @param predicted  [rest vertices, 3]; the motion is added to it
 * @param nearest    optional [rest vertices, 3]: the state's point nearest to each predicted one
 * @retval SUPINE_ERROR_MESH  as supine_patient_check_boxes
 * @retval SUPINE_ERROR_NUMERICAL, SUPINE_ERROR_MEMORY */
supine_status
supine_command_compare_surfaces(const supine_mesh *rest, supine_patient_scan_motion moved,
                                double *predicted, const supine_mesh *state, double *nearest,
                                supine_command_distance distance[SUPINE_PATIENT_MAP_COUNT],
                                supine_error *error);

#endif
