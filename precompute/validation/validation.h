/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Predict the lungs of a person in other states, and compare them with scans. */
#ifndef SUPINE_VALIDATION_H
#define SUPINE_VALIDATION_H

#include "base/arena.h"
#include "precompute/patient/krige.h"
#include "precompute/posed/posed.h"

enum { SUPINE_VALIDATION_STATES_MAX = 8, SUPINE_VALIDATION_TEXT = 48 };

typedef struct supine_validation_state {
  const char *path; /* file of the scanned surface; NULL if only landmarks are given */
  char text[SUPINE_VALIDATION_TEXT]; /* the state as the user wrote it; empty if not given */
  supine_state state;                /* if no volume is given, its kind is SUPINE_VOLUME_DEFAULT */
} supine_validation_state;

/* Names of the compared predictions: by the basis ("predicted"), without motion ("none"), and by a
 * fitted translation and affine map. */
extern const char *const supine_validation_map_names[SUPINE_PATIENT_MAP_COUNT];

/* Statistics of distances, mm. */
typedef struct supine_validation_distance {
  double mean, rms, p95;
  double largest; /* largest distance; between surfaces, the Hausdorff distance */
  /* share of the squared distance that the prediction explains: 1 - (rms / r)^2, where r is the RMS
   * distance of the prediction "none", or of "translation" if body motion is removed; NAN if r is
   * nearly 0 */
  double explained;
  /* Of the prediction at landmarks: RMS expected error, mm, or 0 if unknown; and the share of the
   * landmarks within 1.8 expected errors, 0 to 1. */
  double expected, within;
} supine_validation_distance;

/* A predicted state, and the distances of the prediction from the scan of that state. */
typedef struct supine_validation_outcome {
  supine_state state; /* state->state, with the volume of the scan if none is given */
  supine_pose pose;
  double scale;       /* pose.gains[0][0], the factor on the first lung's displacement along x */
  double millilitres; /* volume minus the volume before the predicted motion, mL */
  double *predicted;  /* [N, 3] predicted positions, mm */
  double *nearest;    /* [N, 3] for each predicted vertex, nearest point of the scan, mm */
  bool has_surface, has_points, has_best;
  supine_validation_distance surface[SUPINE_PATIENT_MAP_COUNT];
  supine_validation_distance points[SUPINE_PATIENT_MAP_COUNT];
  double best_scale; /* `scale` at which the prediction would be nearest to the scan */
  double best_rms;   /* RMS distance of the prediction with the scale best_scale, mm */
} supine_validation_outcome;

typedef struct supine_validation {
  const supine_basis *basis; /* owned by the caller */
  supine_arena arena;
  supine_patient_scan_motion moved; /* kind of body motion to remove before comparing */
  supine_validation_state from;     /* state in which the motion starts */
  double from_scale;                /* `scale` of supine_validation_outcome, for the state `from` */
  double from_millilitres;          /* volume in the state `from`, mL */
  supine_mesh start;                /* surface in the state in which the motion starts */
  size_t count;
  supine_validation_state state[SUPINE_VALIDATION_STATES_MAX];
  supine_validation_outcome outcome[SUPINE_VALIDATION_STATES_MAX];
  size_t line_count; /* states to which supine_validation_find_line fits a line */
  double line_slope; /* slope of the line fitted to best_scale against volume, 1/mL */
  /* Largest deviation of a state's best_scale from the line, relative to the largest |best_scale -
   * from_scale|. */
  double line_off;
} supine_validation;

void supine_validation_free(supine_validation *subject);

/* Compute the surface of subject->basis in the state in which the motion starts: subject->from, by
 * default the scan. */
supine_status supine_validation_begin(supine_validation *subject, supine_error *error);

/* Predict state i, and compare the prediction with the scanned surface and with landmarks.
 * @param scan   the surface in state i; NULL if there is none
 * @param pairs  matched points, of which the first are in the state `from`; NULL if there are none
 */
supine_status supine_validation_compare(supine_validation *subject, size_t i,
                                        const supine_mesh *scan, const supine_patient_pairs *pairs,
                                        supine_error *error);

/* Warn if landmarks lie outside the lungs in which the motion starts, or outside the scan in which it
 * ends. A predicted surface has an error, and is not compared.
 * @param scan  the surface in that state; NULL if there is none */
supine_status supine_validation_check_landmarks(const supine_validation *subject,
                                                const supine_mesh *scan,
                                                const supine_patient_pairs *pairs,
                                                supine_findings *findings, supine_error *error);

/* Warn if the lungs of the scan of state i and those in the state in which the motion starts are
 * hardly of one person (supine_patient_check_person), or a scan holds another volume than its state
 * names. Scans in another posture are not compared. */
void supine_validation_check_person(const supine_validation *subject, size_t i,
                                    const supine_lungs *scan, supine_findings *findings);

/* Fit a line to the best scales of all states whose posture is that of state[0]: best_scale =
 * from_scale + line_slope * (volume - from_millilitres). */
void supine_validation_find_line(supine_validation *subject);

/* Compute the distances between predicted and true second points of pairs, for each prediction in
 * supine_validation_map_names: `predicted`, and maps fitted to the pairs.
 * @param moved      body motion between the scans to fit to `predicted` and remove before comparing
 * @param predicted  [count, 3] positions predicted from the first points of the pairs, mm
 * @param squares    [count] their squared expected errors, mm^2, 0 if unknown; or NULL */
supine_status
supine_validation_points(const supine_patient_pairs *pairs, const double *predicted,
                         const double *squares, supine_patient_scan_motion moved,
                         supine_validation_distance distance[SUPINE_PATIENT_MAP_COUNT],
                         supine_error *error);

/* Compute the distances between `state`, a scanned surface, and a predicted surface, from the
 * vertices of each to the other, for each prediction in supine_validation_map_names: `predicted`,
 * and maps fitted to `start`. Fit maps and body motion by the iterative closest point (ICP) method.
 * For the fitted maps, measure at most 20,000 vertices of the larger surface, and the same share of
 * the other.
 * @param start      surface before the motion, N vertices
 * @param moved      body motion between the scans to fit to `predicted` and remove before comparing
 * @param predicted  [N, 3] positions predicted by the basis, mm; on return, after the fitted motion
 * @param nearest    [N, 3] point of `state` nearest to each predicted vertex, mm; output, or NULL
 */
supine_status
supine_validation_surfaces(const supine_mesh *start, supine_patient_scan_motion moved,
                           double *predicted, const supine_mesh *state, double *nearest,
                           supine_validation_distance distance[SUPINE_PATIENT_MAP_COUNT],
                           supine_error *error);

#endif
