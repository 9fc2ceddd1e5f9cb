/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Declare --posture, --gravity, --volume and --from, and compute the poses that they request. */
#ifndef SUPINE_OPTIONS_STATE_H
#define SUPINE_OPTIONS_STATE_H

#include <supine/runtime.h>

#include "program/options/command.h"

/* Option table of --posture and --gravity, which fill a supine_orientation. */
extern const supine_option supine_options_orientation[];

typedef struct supine_orientation {
  bool given;
  supine_state state; /* gravity, and the volume that --posture names, or SUPINE_VOLUME_DEFAULT */
} supine_orientation;

/* Copy the direction of gravity that --posture or --gravity has set, and the volume if --posture
 * names one. A volume that `state` already has stays there, and is refused beside another. */
supine_status supine_options_state(const supine_orientation *orientation, supine_state *state,
                                   supine_error *error);

enum { SUPINE_POSTURE_NAME_MAX = 48, SUPINE_POSTURE_LIST_MAX = 32 };

/* A state as the user wrote it. */
typedef struct supine_posture_item {
  char name[SUPINE_POSTURE_NAME_MAX];
  supine_state state;
} supine_posture_item;

typedef struct supine_posture_list {
  size_t count;
  size_t with_volume; /* states that name a volume of their own, though `standard` has one */
  supine_posture_item item[SUPINE_POSTURE_LIST_MAX];
} supine_posture_list;

#define SUPINE_POSTURE_HELP                                                                        \
  "supine, prone, left or right (lying on that side), upright, inverted (head down), or a DICOM "  \
  "patient position such as HFS. +DEGREES tilts it, up to 90: supine+15 and left+15 lower the "    \
  "head (Trendelenburg), supine-15 raises it. @DEGREES (or >, quoted) rolls it to the left about " \
  "the long axis: supine@30, supine@-30, supine@30+15. With a volume, it is a state: "             \
  "prone:rest+500"
#define SUPINE_POSTURE_LIST_HELP                                                                   \
  "A posture is a direction of gravity in body axes, X:Y:Z (0.6:0:-0.8), or " SUPINE_POSTURE_HELP  \
  "."

/* Parse a list of states, such as "supine,prone:rest+500,supine+15,0.6:0:-0.8".
 * @param standard  its volume is that of states that name none */
supine_status supine_options_posture_list_parse(const char *text, const supine_state *standard,
                                                supine_posture_list *list, supine_error *error);

/* Refuse a volume for states without one if every state of a list names its own. */
supine_status supine_options_posture_list_check(const supine_posture_list *list, bool has_volume,
                                                supine_error *error);

/* Return "left side" for "left", "right side" for "right", and any other name unchanged. */
const char *supine_options_posture_label(const char *name);

/* Option table of --volume and --allow-folds, which fill a supine_volume_options. */
extern const supine_option supine_options_volume[];

/* Read the value of --volume into a supine_state. */
supine_status supine_options_read_volume(const char *text, void *field, supine_error *error);

/* Read the tidal volume of a breath, mL, and judge it by the check `breath-least`. */
supine_status supine_options_read_breath(const char *text, void *field, supine_error *error);

/* Members of an option of a tidal volume. */
#define SUPINE_BREATH .read = supine_options_read_breath, SUPINE_MEASURES(VOLUME)

/* Option table that holds only --allow-folds, which sets a bool. */
extern const supine_option supine_options_folds[];

typedef struct supine_volume_options {
  supine_state state; /* requested volume; of kind SUPINE_VOLUME_DEFAULT if none was given */
  bool allow_folds;
} supine_volume_options;

#define SUPINE_VOLUME_HELP                                                                         \
  "rest (FRC, the end of a quiet expiration in the posture), full (TLC, full inflation) or scan "  \
  "(the volume in the scan), each alone or with +ML or -ML, such as rest+500; or the absolute "    \
  "volume of gas and tissue in all lungs, as measured in a CT, such as 2600mL"

/* Two tables of the option --from, which fills a supine_from. The default is supine:rest in the
 * first table, and scan in the second. */
extern const supine_option supine_options_from[], supine_options_from_scan[];

typedef struct supine_from {
  bool given;
  supine_state state;
} supine_from;

/* State that displacements are measured from, with its pose and its name in words. */
typedef struct supine_options_reference_pose {
  supine_state state;
  supine_pose pose;
  bool scan;     /* whether the state is that of the scan (supine_basis_scan_pose) */
  char name[96]; /* such as "the scan" or "supine at rest" */
} supine_options_reference_pose;

/* Choose the state that displacements are measured from: the state of --from if it is given; supine
 * at rest if the command compares postures and rest is known; the scan in all other cases. Warn of
 * the state of --from as supine_options_pose does. Statuses as supine_basis_pose. */
supine_status supine_options_reference(const supine_basis *basis, const char *command,
                                       const supine_from *from, bool compares,
                                       supine_options_reference_pose *reference,
                                       supine_error *error);

/* What decides whether the lungs in a state are plausible. */
typedef struct supine_plausible {
  const char *command;
  const supine_state *state;
  double volume, full; /* volume in the state and at full inflation, mL; full is 0 if unknown */
  double folded;       /* share of the surface or of the field that turns over, 0 to 1 */
  const char *parts;   /* what `folded` counts, such as "triangles that turn over" */
  bool allowed;        /* whether implausible lungs cause only a warning */
} supine_plausible;

/* Check that the volume is 10 % to 120 % of full inflation, and that at most 1 % of the parts turn
 * over. */
supine_status supine_options_plausible(const supine_plausible *lungs, supine_error *error);

/* Warn of a pose that supine_basis_check refuses, as the basis was opened to allow it, or, if the
 * basis does not say which volumes its lungs can hold, of triangles that turn over. */
supine_status supine_options_tell_folds(const supine_basis *basis, const char *command,
                                        const supine_state *state, const supine_pose *pose,
                                        supine_error *error);

/* Compute the pose of a state, which supine_basis_pose judges, and call
 * supine_options_tell_folds. */
supine_status supine_options_pose(const supine_basis *basis, const char *command,
                                  const supine_state *state, supine_pose *pose,
                                  supine_error *error);

#endif
