/* SPDX-License-Identifier: MIT */
/** @file
 * The state of the lungs, a posture and a volume, as text and as a struct.
 *
 *     POSTURE  supine, prone, left, right (lying on that side), upright, inverted, a DICOM patient
 *              position, any of them tilted (supine+15 lowers the head), rolled to the left
 *              (supine@30, or supine>30) or both (supine@30+15), or gravity X:Y:Z
 *     VOLUME   rest   the end of a quiet expiration in that posture, with the tissue; or FRC
 *              full   full inflation, with the tissue; or TLC
 *              scan   the volume in the scan
 *              each alone or with +ML or -ML, such as rest+500 or full-3000;
 *              2600mL or 2.6L, an absolute volume of gas and tissue;
 *              left=VOLUME,right=VOLUME for each lung
 *     STATE    POSTURE, VOLUME or POSTURE:VOLUME
 *
 * A number alone is refused, because it does not say to which volume it is relative. Volumes are in
 * mL, of all lungs together unless they are given for each lung.
 *
 * Stability: stable. A change before 1.0 needs a new minor version, and CHANGELOG.md says how to
 * move over. */
#ifndef SUPINE_STATE_H
#define SUPINE_STATE_H

#include <stddef.h>

#include <supine/posture.h>
#include <supine/status.h>

#ifdef __cplusplus
extern "C" {
#endif

/** The reference from which a volume is measured. */
typedef enum supine_volume_kind {
  SUPINE_VOLUME_DEFAULT = 0, /**< the default volume of a basis (supine_basis_pose) */
  SUPINE_VOLUME_REST,        /**< the end of a quiet expiration in the posture */
  SUPINE_VOLUME_FULL,        /**< full inflation */
  SUPINE_VOLUME_SCAN,        /**< the volume in the scan */
  SUPINE_VOLUME_ABSOLUTE,    /**< relative to 0 mL: `ml` is the whole volume of gas and tissue */
  SUPINE_VOLUME_KIND_COUNT
} supine_volume_kind;

/** A volume, given as the difference from a reference such as the volume at rest. */
typedef struct supine_volume {
  supine_volume_kind kind;
  double ml; /**< volume minus the reference volume that `kind` names, mL */
} supine_volume;

/** Largest number of lungs with volumes of their own, and size of a name in bytes with its NUL. */
enum { SUPINE_STATE_LUNGS_MAX = 2, SUPINE_STATE_NAME_SIZE = 16 };

/** A posture, and a volume of all lungs or of each lung. */
typedef struct supine_state {
  double gravity[3];    /**< unit vector in body axes (LPS) that points where things fall */
  supine_volume volume; /**< volume of all lungs together; unused if lung_count is not 0 */
  size_t lung_count;    /**< number of lungs in `lungs`; 0 to use `volume` */
  struct {
    char name[SUPINE_STATE_NAME_SIZE];
    supine_volume volume;
  } lungs[SUPINE_STATE_LUNGS_MAX];
} supine_state;

/** Parse a state: "prone", "rest+500", "left:full-300", "0:1:0:rest", "left=rest,right=rest+200".
 *
 * A posture or volume that the text lacks stays as it is in `state`: set defaults first.
 * @retval SUPINE_ERROR_ARGUMENT  the text is not a state; `error` suggests what may be meant, and
 *                                `state` is unchanged */
SUPINE_API supine_status supine_state_parse(const char *text, supine_state *state,
                                            supine_error *error);

/** Parse a posture without a volume. Statuses: as supine_state_parse. */
SUPINE_API supine_status supine_state_parse_posture(const char *text, supine_state *state,
                                                    supine_error *error);
/** Parse a volume without a posture. Statuses: as supine_state_parse. */
SUPINE_API supine_status supine_state_parse_volume(const char *text, supine_state *state,
                                                   supine_error *error);

/** Join a posture and a volume that were given apart, such as "prone" and "rest+500".
 * @param posture  its gravity is taken, and its volume if it is not of the kind DEFAULT
 * @param volume   its volume is taken, if it is not of the kind DEFAULT
 * @param state    written; may be `posture` or `volume`
 * @retval SUPINE_ERROR_ARGUMENT  both have a volume; `state` is unchanged */
SUPINE_API supine_status supine_state_join(const supine_state *posture, const supine_state *volume,
                                           supine_state *state, supine_error *error);

/** Print a state as text for supine_state_parse, such as "left:rest+500". Volumes have up to 9
 * digits.
 * @param size  size of `text` in bytes; 160 are enough for any state; longer text is cut off
 * @return the length of the whole text, without its NUL */
SUPINE_API size_t supine_state_print(const supine_state *state, char *text, size_t size);

/** Print a state in words, such as "left side at rest + 500 mL". Omit a default volume. Parameters
 * and result: as supine_state_print. */
SUPINE_API size_t supine_state_describe(const supine_state *state, char *text, size_t size);

#ifdef __cplusplus
}
#endif
#endif
