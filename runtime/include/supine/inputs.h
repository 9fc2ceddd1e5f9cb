/* SPDX-License-Identifier: MIT */
/** @file
 * The table of checks: what every kind of input is compared with, from what value the user is told,
 * and from what value the input is refused. docs/inputs.md shows the table; the checks of all
 * libraries take their limits from it.
 *
 * Stability: growing. A minor version may change rows; CHANGELOG.md says how to move over. */
#ifndef SUPINE_INPUTS_H
#define SUPINE_INPUTS_H

#include <stdbool.h>
#include <stddef.h>

#include <supine/status.h>

#ifdef __cplusplus
extern "C" {
#endif

/** The rows of the table. */
typedef enum supine_input_id {
  /* States: a posture and a volume. */
  SUPINE_INPUT_VOLUMES_OF_A_STATE = 0,
  SUPINE_INPUT_TILT,
  SUPINE_INPUT_ROLL,
  SUPINE_INPUT_VOLUME_FINITE,
  SUPINE_INPUT_VOLUME_LEAST,
  SUPINE_INPUT_VOLUME_MOST,
  SUPINE_INPUT_FOLDS,
  SUPINE_INPUT_GAIN,
  SUPINE_INPUT_FIELD_FOLDS,
  SUPINE_INPUT_BREATH,
  SUPINE_INPUT_BREATH_LEAST,
  SUPINE_INPUT_STATE_MEMBERS,
  /* Points, and what is tracked. */
  SUPINE_INPUT_POINT_OUTSIDE,
  SUPINE_INPUT_CONTENT_OUTSIDE,
  SUPINE_INPUT_DEVICE_NAME,
  SUPINE_INPUT_TRACKER_INVALID,
  SUPINE_INPUT_FRAME_LINE,
  /* The patient. */
  SUPINE_INPUT_HEIGHT_LEAST,
  SUPINE_INPUT_HEIGHT_MOST,
  SUPINE_INPUT_REST_SHARE,
  SUPINE_INPUT_LUNG_SHARE,
  SUPINE_INPUT_LUNGS_SMALL,
  /* Label maps. */
  SUPINE_INPUT_LABEL_VALUE,
  SUPINE_INPUT_LABELS_RATIO,
  SUPINE_INPUT_LABELS_PIECES,
  SUPINE_INPUT_LABELS_SIDES,
  SUPINE_INPUT_LABELS_ORDER,
  SUPINE_INPUT_LUNG_PIECES,
  SUPINE_INPUT_LUNG_CUT,
  SUPINE_INPUT_LUNG_HOLLOW,
  SUPINE_INPUT_LUNGS_LEVEL,
  SUPINE_INPUT_VOXELS_BEGIN,
  /* Images that move with the lungs. */
  SUPINE_INPUT_IMAGE_FRAME,
  SUPINE_INPUT_CT_FRAME,
  SUPINE_INPUT_IMAGE_LABELS,
  SUPINE_INPUT_LABELS_LUNGS,
  SUPINE_INPUT_CT_AIR,
  SUPINE_INPUT_CT_SOFT,
  /* Two scans of one person, in one posture. */
  SUPINE_INPUT_ONE_PERSON,
  SUPINE_INPUT_REST_LEAST,
  SUPINE_INPUT_REST_MOST,
  SUPINE_INPUT_SCANS_APART,
  /* Landmarks, and a patient's file. */
  SUPINE_INPUT_LANDMARKS_OUTSIDE,
  SUPINE_INPUT_LANDMARKS_ORDER,
  SUPINE_INPUT_LANDMARKS_MATCH,
  SUPINE_INPUT_PATIENT_BOX,
  SUPINE_INPUT_PATIENT_VOLUME,
  /* Surfaces. */
  SUPINE_INPUT_SURFACE_TURNED,
  /* Lungs located from observed points. */
  SUPINE_INPUT_LOCATE_RESIDUALS,
  SUPINE_INPUT_LOCATE_TURNED,
  SUPINE_INPUT_LOCATE_STRETCHED,
  /* Words. */
  SUPINE_INPUT_SUGGESTION,
  /* Displacement fields of another simulator. */
  SUPINE_INPUT_FIELDS_DIRECTIONS,
  SUPINE_INPUT_FIELDS_GAP,
  SUPINE_INPUT_FIELDS_POSITIONS,
  SUPINE_INPUT_FIELDS_GRAVITY,
  SUPINE_INPUT_FIELDS_REPEATED,
  SUPINE_INPUT_FIELDS_COPY,
  SUPINE_INPUT_FIELDS_ZERO,
  SUPINE_INPUT_FIELDS_NODE,
  SUPINE_INPUT_FIELDS_UNIT,
  SUPINE_INPUT_FIELDS_LARGE,
  SUPINE_INPUT_FIELDS_FRAME,
  SUPINE_INPUT_FIELDS_RUN_SIZE,
  SUPINE_INPUT_FIELDS_RUN_ERROR,
  SUPINE_INPUT_FIELDS_LEFT_OUT,
  SUPINE_INPUT_FIELDS_VOLUME,
  /* A basis that was made. */
  SUPINE_INPUT_BASIS_ERROR,
  SUPINE_INPUT_COUNT /**< sentinel: the number of rows */
} supine_input_id;

/** The interfaces that take an input. */
enum {
  SUPINE_INPUT_BY_COMMAND = 1,
  SUPINE_INPUT_BY_C = 2,
  SUPINE_INPUT_BY_PYTHON = 4,
  SUPINE_INPUT_BY_JAVASCRIPT = 8
};

/** A row of the table: an input is told or refused if the measured number is above the limit, or
 * below it if `below` is set. A limit that is NaN does not exist. */
typedef struct supine_input {
  const char *name;     /**< such as "tilt"; tests/inputs.py has a right and a wrong case for it */
  const char *group;    /**< kind of input, such as "state" */
  const char *input;    /**< what is given */
  const char *against;  /**< what it is compared with */
  const char *measured; /**< what is measured, with its unit */
  bool below;           /**< values below the limits are told and refused, not those above */
  double told;          /**< limit from which the input is taken with a warning */
  double refused;       /**< limit from which the input is refused */
  const char *evidence; /**< where the limits come from */
  int people;           /**< number of people that were measured; 0 if none was measured */
  int n;                /**< number of measurements */
  unsigned interfaces;  /**< sum of SUPINE_INPUT_BY_... */
} supine_input;

typedef enum supine_input_verdict {
  SUPINE_INPUT_TAKEN = 0,
  SUPINE_INPUT_TOLD,
  SUPINE_INPUT_REFUSED
} supine_input_verdict;

/** Return a row of the table; NULL for a number that is none. */
SUPINE_API const supine_input *supine_input_get(supine_input_id id);

/** Return the verdict of a row on a measured number. A number that is NaN is refused. */
SUPINE_API supine_input_verdict supine_input_judge(supine_input_id id, double measured);

#ifdef __cplusplus
}
#endif
#endif
