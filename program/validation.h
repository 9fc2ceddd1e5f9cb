/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Predict states of a person by a basis and compare them with scans, for 'supine validate'. */
#ifndef SUPINE_COMMAND_VALIDATION_H
#define SUPINE_COMMAND_VALIDATION_H

#include "precompute/patient/krige.h"
#include "precompute/source.h"
#include "program/options/state_options.h"

enum { SUPINE_COMMAND_STATES_MAX = 8 };

typedef struct supine_command_state {
  const char *path;                      /* file of the surface; NULL: landmarks only */
  char posture[SUPINE_POSTURE_NAME_MAX]; /* posture as given; empty: none */
  supine_state state;                    /* volume of kind SUPINE_VOLUME_DEFAULT: not given */
} supine_command_state;

/* Names of the maps: "predicted", "none", "translation" and "affine". */
extern const char *const supine_command_map_names[SUPINE_PATIENT_MAP_COUNT];

/* Statistics of distances, mm. */
typedef struct supine_command_distance {
  double mean, rms, p95;
  double largest;   /* largest distance; between surfaces, the Hausdorff distance */
  double explained; /* 1 - (rms / r)^2, with r the RMS distance without a map, or with a translation
                       if motion between the scans is removed; NAN if nothing moved */
} supine_command_distance;

/* Prediction for one state, and its distances from the scan. */
typedef struct supine_command_outcome {
  supine_pose pose;
  double scale;       /* first gain of the pose */
  double millilitres; /* volume above the state that motion starts from, mL */
  double *predicted;  /* [N, 3] predicted positions, mm */
  double *nearest;    /* [N, 3] nearest points of the scanned surface, mm */
  bool has_surface, has_points, has_best;
  supine_command_distance surface[SUPINE_PATIENT_MAP_COUNT];
  supine_command_distance points[SUPINE_PATIENT_MAP_COUNT];
  double best_scale; /* scale with the least distance to the surface */
  double best_rms;   /* RMS distance at best_scale, mm */
} supine_command_outcome;

typedef struct supine_command_subject {
  supine_basis *basis;
  supine_patient_scan_motion moved; /* motion between the scans that is removed */
  supine_command_state from;
  double from_scale, from_millilitres; /* at the start of motion: first gain, and volume in mL */
  supine_mesh rest;                    /* surface that motion starts from */
  size_t count;
  supine_command_state state[SUPINE_COMMAND_STATES_MAX];
  supine_command_outcome outcome[SUPINE_COMMAND_STATES_MAX];
  size_t line_count; /* number of states in the posture of the first state, to which a line is
                        fitted */
  double line_slope; /* slope of the line: scale per mL */
  double line_off;   /* largest residual of the line, as a share of the largest scale */
} supine_command_subject;

void supine_command_subject_free(supine_command_subject *subject);

/* Open a basis and compute the surface that motion starts from: the surface of the state `from`, or
 * the scan's if `from` names no posture.
 * @retval any status of the run-time library */
supine_status supine_command_subject_open(const char *path, supine_command_subject *subject,
                                          supine_error *error);

/* Predict state i, and compare it with its surface and with landmarks (NULL: none).
 * @param reverse  whether the landmarks go from the other state to the start of motion
 * @retval any status of loading and comparing */
supine_status supine_command_validate_state(supine_command_subject *subject, size_t i,
                                            const supine_source_options *source,
                                            const char *landmarks, bool reverse,
                                            supine_error *error);

/* Fit a line to the best scales over volume, through the start of motion. */
void supine_command_find_line(supine_command_subject *subject);

/* Draw the errors on the surface, one panel for each state.
 * @retval any status of supine_render_picture_save */
supine_status supine_command_draw_errors(const supine_command_subject *subject, const char *path,
                                         supine_error *error);

/* Compute distances of matched points from their predictions by each map.
 * @param moved      motion between the scans, which is fitted to the prediction and removed
 * @param predicted  [count, 3] predicted positions of the first points of the pairs, mm
 * @retval SUPINE_ERROR_NUMERICAL  the points lie in one plane
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_command_compare_points(
    const supine_patient_pairs *pairs, const double *predicted, supine_patient_scan_motion moved,
    supine_command_distance distance[SUPINE_PATIENT_MAP_COUNT], supine_error *error);

/* Compute distances between a scanned surface and its predictions by each map, from the vertices of
 * each surface to the other. The maps are fitted by iterated nearest points.
 * @param rest       surface that motion starts from, with N vertices
 * @param moved      motion between the scans, which is fitted to the prediction and removed
 * @param predicted  [N, 3] predicted positions, mm; out: with the motion removed
 * @param state      scanned surface
 * @param nearest    [N, 3] nearest points of the scanned surface, mm; NULL: not needed
 * @retval SUPINE_ERROR_MESH  as supine_patient_check_boxes
 * @retval SUPINE_ERROR_NUMERICAL, SUPINE_ERROR_MEMORY */
supine_status
supine_command_compare_surfaces(const supine_mesh *rest, supine_patient_scan_motion moved,
                                double *predicted, const supine_mesh *state, double *nearest,
                                supine_command_distance distance[SUPINE_PATIENT_MAP_COUNT],
                                supine_error *error);

#endif
