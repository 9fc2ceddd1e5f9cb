/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Predict states of a person by a basis and compare them with scans, for 'supine validate'. */
#ifndef SUPINE_COMMAND_VALIDATION_H
#define SUPINE_COMMAND_VALIDATION_H

#include "precompute/patient/krige.h"
#include "precompute/source.h"
#include "program/options/state_options.h"

enum { SUPINE_COMMAND_STATES_MAX = 8 };

typedef struct supine_command_state {
  const char *path;                   /* file of the surface; NULL if only landmarks are given */
  char text[SUPINE_POSTURE_NAME_MAX]; /* as given; empty if not given */
  supine_state state;                 /* its volume is of kind SUPINE_VOLUME_DEFAULT if not given */
} supine_command_state;

/* Names of the maps: "predicted", "none", "translation" and "affine". */
extern const char *const supine_command_map_names[SUPINE_PATIENT_MAP_COUNT];

/* Statistics of distances, mm. */
typedef struct supine_command_distance {
  double mean, rms, p95;
  double largest;   /* largest distance; between surfaces, the Hausdorff distance */
  double explained; /* 1 - (rms / r)^2, where r is the rms without motion, or of a translation if
                       motion between the scans is removed; NAN if nothing moved */
} supine_command_distance;

/* Prediction for one state, and its distances from the scan. */
typedef struct supine_command_outcome {
  supine_pose pose;
  double scale;       /* first gain of `pose` */
  double millilitres; /* volume above the state that motion starts from, mL */
  double *predicted;  /* [N, 3] predicted positions, mm */
  double *nearest;    /* [N, 3] nearest points of the scanned surface, mm */
  bool has_surface, has_points, has_best;
  supine_command_distance surface[SUPINE_PATIENT_MAP_COUNT];
  supine_command_distance points[SUPINE_PATIENT_MAP_COUNT];
  double best_scale; /* scale that comes nearest to the surface */
  double best_rms;   /* RMS distance at best_scale, mm */
} supine_command_outcome;

typedef struct supine_command_subject {
  supine_basis *basis;
  supine_patient_scan_motion moved; /* motion between the scans, which is removed */
  supine_command_state from;
  double from_scale;       /* first gain at the start of motion */
  double from_millilitres; /* volume at the start of motion, mL */
  supine_mesh start;       /* surface that motion starts from */
  size_t count;
  supine_command_state state[SUPINE_COMMAND_STATES_MAX];
  supine_command_outcome outcome[SUPINE_COMMAND_STATES_MAX];
  size_t line_count; /* number of fitted states, which are in the posture of the first state */
  double line_slope; /* slope of the fitted line: scale per mL */
  double line_off;   /* largest residual of the fitted line, as a share of the largest scale */
} supine_command_subject;

void supine_command_subject_free(supine_command_subject *subject);

/* Open a basis and compute the surface that motion starts from: the surface in the state `from`, or
 * in the scan if `from` was not given.
 * @retval any status of the run-time library */
supine_status supine_command_subject_open(const char *path, supine_command_subject *subject,
                                          supine_error *error);

/* Predict state i, and compare it with its surface and with landmarks.
 * @param landmarks  file of matched points; NULL if there are none
 * @param reverse    whether the first points of the landmarks are in state i
 * @retval any status of loading and comparing */
supine_status supine_command_validate_state(supine_command_subject *subject, size_t i,
                                            const supine_source_options *source,
                                            const char *landmarks, bool reverse,
                                            supine_error *error);

/* Fit the best scales as a linear function of volume. The line passes through the start of
 * motion. */
void supine_command_find_line(supine_command_subject *subject);

/* Draw the errors on the surface, one panel for each state.
 * @retval any status of supine_render_picture_save */
supine_status supine_command_draw_errors(const supine_command_subject *subject, const char *path,
                                         supine_error *error);

/* For each map, compute the distances between matched points and their predictions.
 * @param moved      motion between the scans, which is fitted to the prediction and removed
 * @param predicted  [count, 3] predicted positions of the first points of the pairs, mm
 * @retval SUPINE_ERROR_NUMERICAL  the points lie in one plane
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_command_compare_points(
    const supine_patient_pairs *pairs, const double *predicted, supine_patient_scan_motion moved,
    supine_command_distance distance[SUPINE_PATIENT_MAP_COUNT], supine_error *error);

/* For each map, compute the distances between a scanned surface and its prediction, from the
 * vertices of each surface to the other. The maps are fitted by iterated nearest points.
 * @param start      surface that motion starts from, with N vertices
 * @param moved      motion between the scans, which is fitted to the prediction and removed
 * @param predicted  [N, 3] predicted positions, mm, from which the motion is then removed
 * @param state      scanned surface
 * @param nearest    [N, 3] nearest points of the scanned surface, mm; output, or NULL
 * @retval SUPINE_ERROR_MESH  as supine_patient_check_boxes
 * @retval SUPINE_ERROR_NUMERICAL, SUPINE_ERROR_MEMORY */
supine_status
supine_command_compare_surfaces(const supine_mesh *start, supine_patient_scan_motion moved,
                                double *predicted, const supine_mesh *state, double *nearest,
                                supine_command_distance distance[SUPINE_PATIENT_MAP_COUNT],
                                supine_error *error);

#endif
