/* SPDX-License-Identifier: MIT */
/** @file
 * The state of a lung: posture and volume.
 *
 *     POSTURE  supine, prone, left, right (lying on that side), upright, inverted, a DICOM patient
 *              position, any of them tilted (supine+15), or gravity X:Y:Z
 *     VOLUME   rest   end of a quiet expiration in that posture (FRC, with the tissue)
 *              full   full inflation (TLC, with the tissue)
 *              scan   what the scan held
 *              each with +ML or -ML: rest+500, full-3000; or absolute, gas and tissue: 2600mL
 *              left=VOLUME,right=VOLUME: lung by lung
 *     STATE    POSTURE, VOLUME or POSTURE:VOLUME
 *
 * A number alone is no volume: it would not say what it counts from. Volumes are in mL, of all
 * lungs together unless lungs are named. */
#ifndef SUPINE_STATE_H
#define SUPINE_STATE_H

#include <stddef.h>

#include <supine/posture.h>
#include <supine/status.h>

#ifdef __cplusplus
extern "C" {
#endif

/** What a volume counts from. */
typedef enum supine_volume_kind {
  SUPINE_VOLUME_DEFAULT = 0, /**< not said: supine_basis_pose has each basis' default */
  SUPINE_VOLUME_REST,        /**< the end of a quiet expiration in the posture */
  SUPINE_VOLUME_FULL,        /**< full inflation */
  SUPINE_VOLUME_SCAN,        /**< what the scan held */
  SUPINE_VOLUME_ABSOLUTE,    /**< gas and tissue, as a CT shows them */
  SUPINE_VOLUME_KIND_COUNT
} supine_volume_kind;

typedef struct supine_volume {
  supine_volume_kind kind;
  double ml; /**< mL beyond the kind's volume; of ABSOLUTE the volume itself */
} supine_volume;

enum { SUPINE_STATE_LUNGS_MAX = 2, SUPINE_STATE_NAME_SIZE = 16 };

typedef struct supine_state {
  double gravity[3];    /**< unit vector in body axes (LPS) that points where things fall */
  supine_volume volume; /**< of all lungs together; unused where lungs are named */
  size_t lung_count;    /**< lungs named below; 0: none */
  struct {
    char name[SUPINE_STATE_NAME_SIZE];
    supine_volume volume;
  } lungs[SUPINE_STATE_LUNGS_MAX];
} supine_state;

/** Parse "prone", "rest+500", "left:full-300", "0:1:0:rest", "left=rest,right=rest+200".
 *
 * What the text does not say stays as it is in `state`, so set defaults first.
 * @retval SUPINE_ERROR_ARGUMENT  anything else; `error` says what it could mean, `state` is
 *                                untouched */
SUPINE_API supine_status supine_state_parse(const char *text, supine_state *state,
                                            supine_error *error);

/** Parse a posture alone, or a volume alone, likewise. */
SUPINE_API supine_status supine_state_parse_posture(const char *text, supine_state *state,
                                                    supine_error *error);
SUPINE_API supine_status supine_state_parse_volume(const char *text, supine_state *state,
                                                   supine_error *error);

/** Print a state so that supine_state_parse reads it back: "left:rest+500". Volumes keep 9 digits.
 * @param size  of `text`; 160 is enough for any state
 * @return the length that the whole text has */
SUPINE_API size_t supine_state_print(const supine_state *state, char *text, size_t size);

/** Print a state for people: "left side at rest + 500 mL". The volume is left out where it is the
 * default. Sizes as supine_state_print. */
SUPINE_API size_t supine_state_describe(const supine_state *state, char *text, size_t size);

#ifdef __cplusplus
}
#endif
#endif
