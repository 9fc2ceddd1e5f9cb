/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Predict the lungs of a person in other states, and compare them with scans. */
#ifndef SUPINE_COMMAND_VALIDATION_H
#define SUPINE_COMMAND_VALIDATION_H

#include "precompute/patient/krige.h"
#include "precompute/source.h"
#include "program/options/state_options.h"

enum { SUPINE_COMMAND_STATES_MAX = 8 };

typedef struct supine_command_state {
  const char *path; /* file of the scanned surface; NULL if only landmarks are given */
  char text[SUPINE_POSTURE_NAME_MAX]; /* the state as the user wrote it; empty if not given */
  supine_state state;                 /* if no volume is given, its kind is SUPINE_VOLUME_DEFAULT */
} supine_command_state;

/* Names of the compared predictions: by the basis ("predicted"), without motion ("none"), and by a
 * fitted translation and affine map. */
extern const char *const supine_command_map_names[SUPINE_PATIENT_MAP_COUNT];

/* Statistics of distances, mm. */
typedef struct supine_command_distance {
  double mean, rms, p95;
  double largest; /* largest distance; between surfaces, the Hausdorff distance */
  double
      explained; /* 1 - (rms / r)^2, where r is the RMS distance of the prediction "none" (no
                    motion) or, if body motion is removed, of "translation"; NAN if r is nearly 0 */
} supine_command_distance;

/* A predicted state, and the distances of the prediction from the scan of that state. */
typedef struct supine_command_outcome {
  supine_pose pose;
  double scale;       /* pose.gains[0][0], the factor on the first lung's displacement along x */
  double millilitres; /* volume minus the volume before the predicted motion, mL */
  double *predicted;  /* [N, 3] predicted positions, mm */
  double *nearest;    /* [N, 3] nearest points of the scanned surface, mm */
  bool has_surface, has_points, has_best;
  supine_command_distance surface[SUPINE_PATIENT_MAP_COUNT];
  supine_command_distance points[SUPINE_PATIENT_MAP_COUNT];
  double best_scale; /* `scale` at which the prediction would be nearest to the scan */
  double best_rms;   /* RMS distance from the scanned surface at best_scale, mm */
} supine_command_outcome;

typedef struct supine_command_subject {
  supine_basis *basis;
  supine_patient_scan_motion moved; /* kind of body motion to remove before comparing */
  supine_command_state from;        /* state in which the motion starts */
  double from_scale;       /* factor on the first lung's displacement along x in the state `from` */
  double from_millilitres; /* volume in the state `from`, mL */
  supine_mesh start;       /* surface in the state `from` */
  size_t count;
  supine_command_state state[SUPINE_COMMAND_STATES_MAX];
  supine_command_outcome outcome[SUPINE_COMMAND_STATES_MAX];
  size_t line_count; /* number of states to which best_scale = from_scale + line_slope * volume is
                        fitted */
  double line_slope; /* fitted change of best_scale per volume, 1/mL */
  double line_off;   /* largest |best_scale - fitted line| / largest |best_scale - from_scale| */
} supine_command_subject;

void supine_command_subject_free(supine_command_subject *subject);

/* Open a basis and compute the surface in the state `from`, in which the motion starts: the scan,
 * if `from` was not given.
 * @retval any status of the run-time library */
supine_status supine_command_subject_open(const char *path, supine_command_subject *subject,
                                          supine_error *error);

/* Predict state i, and compare the prediction with the scanned surface and with landmarks.
 * @param landmarks  file of matched points; NULL if there are none
 * @param reverse    whether the first point of each pair of landmarks is in state i
 * @retval any status of loading and comparing */
supine_status supine_command_validate_state(supine_command_subject *subject, size_t i,
                                            const supine_source_options *source,
                                            const char *landmarks, bool reverse,
                                            supine_error *error);

/* Fit the line best_scale = from_scale + line_slope * volume to all states in the posture of the
 * first state. best_scale is the factor of the displacement at which the prediction is nearest to
 * the scan, from_scale is the factor in the state `from`, and the volume counts from that state. */
void supine_command_find_line(supine_command_subject *subject);

/* Draw the distance between prediction and scanned surface, in one panel for each state.
 * @retval any status of supine_render_picture_save */
supine_status supine_command_draw_errors(const supine_command_subject *subject, const char *path,
                                         supine_error *error);

/* Compute the distances of the second points of pairs from each of the predictions in
 * supine_command_map_names.
 * @param moved      kind of body motion between the scans; fitted from the predicted to the
 *   second points, and applied to the predicted points before the comparison
 * @param predicted  [count, 3] positions predicted from the first points of the pairs, mm
 * @retval SUPINE_ERROR_NUMERICAL  the points lie in one plane
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_command_compare_points(
    const supine_patient_pairs *pairs, const double *predicted, supine_patient_scan_motion moved,
    supine_command_distance distance[SUPINE_PATIENT_MAP_COUNT], supine_error *error);

/* Compute the distances between a scanned surface and each of the predictions in
 * supine_command_map_names, from the vertices of each surface to the other. Maps and body motion
 * are fitted by the iterative closest point (ICP) method.
 * @param start      surface before the motion, N vertices
 * @param moved      kind of body motion between the scans; fitted from the predicted to the
 *   scanned surface, and applied to the predicted surface before the comparison
 * @param predicted  [N, 3] predicted positions, mm; on return, after the fitted body motion
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
