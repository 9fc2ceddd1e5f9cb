/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Declare --posture, --gravity, --volume and --from, and compute the poses that they request. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <supine/inputs.h>

#include "base/arena.h"
#include "base/number.h"
#include "base/remedy.h"
#include "precompute/posed/posed.h"
#include "program/options/basis_input.h"
#include "program/options/state_options.h"
#include "program/options/surface_options.h"
#include "runtime/checks.h"

static supine_status read_state(const char *text, void *field, supine_error *error) {
  *(supine_state *)field = (supine_state){.gravity = {0.0}}; /* zero if the text has no posture */
  return supine_state_parse(text, field, error);
}

/* Read the direction X,Y,Z of gravity, by parsing it as the posture X:Y:Z. */
static supine_status read_gravity(const char *text, void *field, supine_error *error) {
  char posture[128];
  double numbers[3];
  if (!supine_options_parse_numbers(text, 3, numbers)) {
    return SUPINE_ERROR_ARGUMENT;
  }
  (void)supine_print_text(posture, sizeof posture, "%.17g:%.17g:%.17g", numbers[0], numbers[1],
                          numbers[2]);
  return supine_state_parse_posture(posture, field, error);
}

#define GRAVITY                                                                                    \
  SUPINE_FILLS(supine_orientation, state), SUPINE_SAYS_GIVEN(supine_orientation, given),           \
      .rivals = "gravity"

static const char *const postures[] = {"supine",  "prone",    "left", "right",
                                       "upright", "inverted", NULL};

const supine_option supine_options_orientation[] = {
    {"posture", 0, "STATE", SUPINE_POSTURE_HELP, GRAVITY, .read = read_state, .choices = postures},
    {"gravity", 0, "X,Y,Z",
     "direction of gravity in body axes, instead of a posture: x to the left, y to the back, z to "
     "the head; 0,1,0 is supine",
     GRAVITY, .read = read_gravity, .wants = "three finite numbers, X,Y,Z"},
    {.name = NULL}};

supine_status supine_options_state(const supine_orientation *orientation, supine_state *state,
                                   supine_error *error) {
  const supine_state *given = &orientation->state;
  SUPINE_TRY(supine_state_join(given, state, state, error));
  SUPINE_REFUSE_IF(
      !(given->gravity[0] != 0.0 || given->gravity[1] != 0.0 || given->gravity[2] != 0.0), error,
      SUPINE_ERROR_ARGUMENT, "the posture is missing: give --posture or --gravity");
  return SUPINE_OK;
}

supine_status supine_options_posture_list_parse(const char *text, const supine_state *standard,
                                                supine_posture_list *list, supine_error *error) {
  char name[2 * SUPINE_POSTURE_NAME_MAX];
  *list = (supine_posture_list){.count = 0};
  for (const char *at = text; supine_options_next_item(&at, name, sizeof name);) {
    SUPINE_REFUSE_IF(list->count == SUPINE_POSTURE_LIST_MAX, error, SUPINE_ERROR_ARGUMENT,
                     "more than %d postures: name fewer", SUPINE_POSTURE_LIST_MAX);
    supine_posture_item *item = &list->item[list->count++];
    SUPINE_REFUSE_IF(name[0] == '\0', error, SUPINE_ERROR_ARGUMENT,
                     "no posture '' in '%s': remove a comma, or name a posture", text);
    (void)snprintf(item->name, sizeof item->name, "%.*s", (int)sizeof item->name - 1, name);
    item->state = (supine_state){.gravity = {0.0, 1.0, 0.0}}; /* supine, if no posture is named */
    SUPINE_TRY(supine_state_parse(name, &item->state, error));
    if (supine_state_join(&item->state, standard, &item->state, NULL) != SUPINE_OK) {
      ++list->with_volume; /* the state's own volume stays */
    }
  }
  return SUPINE_OK;
}

supine_status supine_options_posture_list_check(const supine_posture_list *list, bool has_volume,
                                                supine_error *error) {
  SUPINE_REFUSE_IF(has_volume && list->with_volume == list->count, error, SUPINE_ERROR_ARGUMENT,
                   "every posture names its own volume, and another volume is given: leave it out");
  return SUPINE_OK;
}

const char *supine_options_posture_label(const char *name) {
  if (strcmp(name, "left") == 0) {
    return "left side";
  }
  return strcmp(name, "right") == 0 ? "right side" : name;
}

supine_status supine_options_read_volume(const char *text, void *field, supine_error *error) {
  return supine_state_parse_volume(text, field, error);
}

supine_status supine_options_read_breath(const char *text, void *field, supine_error *error) {
  double ml = 0.0;
  SUPINE_TRY(supine_quantity_parse(text, SUPINE_QUANTITY_VOLUME, 1, &ml, error));
  const supine_input_verdict verdict = supine_input_judge(SUPINE_INPUT_BREATH_LEAST, ml);
  SUPINE_REFUSE_IF(verdict == SUPINE_INPUT_REFUSED, error, SUPINE_ERROR_ARGUMENT,
                   "'%s' is no breath: give %gmL or more, such as 500mL", text,
                   supine_input_get(SUPINE_INPUT_BREATH_LEAST)->refused);
  *(double *)field = ml;
  return SUPINE_OK;
}

const supine_option supine_options_folds[] = {
    {"allow-folds", 0, NULL,
     "allow volumes below 10 % or above 120 % of full inflation, surfaces with more than 1 % of "
     "their triangles turned over, and fields that fold in more than 1 % as many cells as are "
     "inside the lungs",
     .kind = SUPINE_OPTION_FLAG, .size = sizeof(bool)},
    {.name = NULL}};

const supine_option supine_options_volume[] = {
    {"volume", 0, "VOLUME",
     SUPINE_VOLUME_HELP
     "\nleft=VOLUME,right=VOLUME: a volume for each lung; name every lung\nDefault rest; for a "
     "basis made by 'supine precompute' with --scanned none or --law paper, scan+500. A basis made "
     "with --fields takes the volumes that were simulated, if they were given for each direction",
     SUPINE_FILLS(supine_volume_options, state), .read = supine_options_read_volume,
     .rivals = "breath"},
    {.table = supine_options_folds, SUPINE_FILLS(supine_volume_options, allow_folds)},
    {.name = NULL}};

#define FROM(standard)                                                                             \
  {                                                                                                \
    "from", 0, "STATE",                                                                            \
        "state that displacements are measured from: POSTURE, VOLUME or POSTURE:VOLUME. "          \
        "POSTURE is a name such as prone; VOLUME is rest (FRC), full (TLC) or scan, each alone "   \
        "or with +ML or -ML, or an absolute volume such as 2600mL; default " standard,             \
        SUPINE_FILLS(supine_from, state), SUPINE_SAYS_GIVEN(supine_from, given),                   \
        .read = read_state                                                                         \
  }
const supine_option supine_options_from[] = {FROM("supine:rest, or the scan if rest is unknown"),
                                             {.name = NULL}};
const supine_option supine_options_from_scan[] = {FROM("scan"), {.name = NULL}};

supine_status supine_options_reference(const supine_basis *basis, const char *command,
                                       const supine_from *from, bool compares,
                                       supine_options_reference_pose *reference,
                                       supine_error *error) {
  const supine_state in_scan = supine_basis_scan(basis);
  supine_state state = {.gravity = {0.0, 1.0, 0.0}, .volume = {SUPINE_VOLUME_REST, 0.0}};
  bool scan = !from->given && !(compares && supine_basis_get_info(basis)->has_rest);
  if (from->given) {
    const double *g = from->state.gravity;
    const bool posed = g[0] != 0.0 || g[1] != 0.0 || g[2] != 0.0;
    state = from->state;
    /* If --from gives no posture, use supine or, for the volume `scan`, the posture of the scan. */
    const bool own = state.lung_count == 0 && state.volume.kind == SUPINE_VOLUME_SCAN;
    scan = !posed && own && state.volume.ml == 0.0;
    if (!posed) {
      state.gravity[1] = 1.0;
    }
    if (!posed && own) {
      memcpy(state.gravity, in_scan.gravity, sizeof state.gravity);
    }
  } else if (scan) {
    state = in_scan;
  }
  supine_error inner;
  supine_status status;
  if (scan) {
    status = supine_basis_scan_pose(basis, &reference->pose, &inner);
  } else {
    status = supine_basis_pose(basis, &state, &reference->pose, &inner);
  }
  reference->state = state;
  reference->scan = scan;
  if (status != SUPINE_OK) {
    return supine_error_wrap(error, &inner, "%s", from->given ? "--from: " : "");
  }
  if (from->given && !scan) {
    SUPINE_TRY(supine_options_tell_folds(basis, command, &state, &reference->pose, error));
  }
  if (state.lung_count == 0 && state.volume.kind == SUPINE_VOLUME_DEFAULT) {
    state.volume = supine_basis_default_volume(basis); /* the name states the volume */
  }
  if (scan) {
    (void)snprintf(reference->name, sizeof reference->name, "the scan");
  } else {
    (void)supine_state_describe(&state, reference->name, sizeof reference->name);
  }
  return SUPINE_OK;
}

/* Refuse what is wrong with a state, or warn of it if that is allowed. */
static supine_status refuse_or_warn(const char *command, const supine_state *state,
                                    const char *wrong, bool allowed, supine_error *error) {
  char text[160];
  (void)supine_state_describe(state, text, sizeof text);
  const supine_remedy advice[SUPINE_REMEDIES_MAX] = {supine_remedy_allow_folds()};
  SUPINE_REFUSE_ADVISE(!allowed, error, advice, SUPINE_ERROR_NUMERICAL,
                       "%s: %s: choose a volume nearer to rest", text, wrong);
  supine_options_say(command, "warning: %s: %s", text, wrong);
  return SUPINE_OK;
}

supine_status supine_options_plausible(const supine_plausible *lungs, supine_error *error) {
  char wrong[192];
  const double share = lungs->full > 0.0 ? lungs->volume / lungs->full : 1.0;
  const double least = supine_input_get(SUPINE_INPUT_VOLUME_LEAST)->refused;
  const double most = supine_input_get(SUPINE_INPUT_VOLUME_MOST)->refused;
  const double folded = supine_input_get(SUPINE_INPUT_FIELD_FOLDS)->refused;
  if (!(share >= least && share <= most)) {
    (void)supine_print_text(
        wrong, sizeof wrong,
        "%.0f mL are %.0f %% of full inflation (%.0f mL), outside the %.0f to %.0f %% "
        "that lungs hold",
        lungs->volume, 100.0 * share, lungs->full, 100.0 * least, 100.0 * most);
  } else if (lungs->folded > folded) {
    (void)supine_print_text(wrong, sizeof wrong, "%s: %.3g %% (at most %g %%)", lungs->parts,
                            100.0 * lungs->folded, 100.0 * folded);
  } else {
    return SUPINE_OK;
  }
  return refuse_or_warn(lungs->command, lungs->state, wrong, lungs->allowed, error);
}

/* Warn if more than the share of the check `folds` of the triangles of a pose turn over. */
static supine_status tell_triangles(const supine_basis *basis, const char *command,
                                    const supine_state *state, const supine_pose *pose,
                                    supine_error *error) {
  supine_plausible lungs = {.command = command,
                            .state = state,
                            .parts = "the surface folds; triangles that turn over",
                            .allowed = true};
  SUPINE_FREED_BY(supine_mesh_free) supine_mesh mesh = {0};
  SUPINE_FREED_BY(supine_mesh_free) supine_mesh moved = {0};
  SUPINE_TRY(supine_posed_mesh(basis, NULL, &mesh, error));
  SUPINE_TRY(supine_posed_mesh(basis, pose, &moved, error));
  lungs.folded = supine_mesh_turned_over(&mesh, moved.vertices);
  return supine_options_plausible(&lungs, error);
}

supine_status supine_options_tell_folds(const supine_basis *basis, const char *command,
                                        const supine_state *state, const supine_pose *pose,
                                        supine_error *error) {
  supine_findings findings = {.count = 0};
  if (!supine_basis_has_range_of_volumes(basis)) {
    return tell_triangles(basis, command, state, pose, error);
  }
  supine_basis_tell(basis, state, pose, &findings);
  supine_options_say_findings(command, &findings);
  return SUPINE_OK;
}

supine_status supine_options_pose(const supine_basis *basis, const char *command,
                                  const supine_state *state, supine_pose *pose,
                                  supine_error *error) {
  SUPINE_TRY(supine_basis_pose(basis, state, pose, error));
  return supine_options_tell_folds(basis, command, state, pose, error);
}
