/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine validate: compare a basis with other states of the same person. */
#include <string.h>

#include "base/arena.h"
#include "base/text.h"

#include "program/command/list.h"
#include "program/command/validation_report.h"
#include "program/options/basis_input.h"
#include "program/options/model_options.h"
#include "program/options/state_options.h"
#include "program/options/surface_options.h"

static const char name[] = "validate";

typedef struct request {
  const char *path;
  supine_landmark_options landmarks;
  supine_validation_state from, to, state[SUPINE_VALIDATION_STATES_MAX];
  size_t count;
  supine_source_options source;
} request;

/* Read a state, such as "prone", "prone:rest+500", "0.6:0:-0.8" or "0.6:0:-0.8:full". */
static supine_status read_state(const char *text, void *field, supine_error *error) {
  supine_validation_state *state = field;
  if (text[0] == '\0' || strlen(text) >= sizeof state->text) {
    return SUPINE_ERROR_ARGUMENT;
  }
  (void)snprintf(state->text, sizeof state->text, "%s", text);
  return supine_state_parse(text, &state->state, error);
}

/* Append a state, such as "prone.ply" or "prone:rest+500:prone.ply", to the request. */
static supine_status append_state(const char *text, void *field, supine_error *error) {
  request *wanted = field;
  supine_validation_state *state = &wanted->state[wanted->count];
  const char *colon = strrchr(text, ':');
  char posture[SUPINE_VALIDATION_TEXT + 32];
  if (wanted->count == SUPINE_VALIDATION_STATES_MAX) {
    return SUPINE_ERROR_ARGUMENT;
  }
  ++wanted->count;
  state->path = colon != NULL ? colon + 1 : text;
  if (colon == NULL) {
    return SUPINE_OK;
  }
  const size_t length = (size_t)(colon - text);
  if (length >= sizeof posture || colon[1] == '\0') {
    return SUPINE_ERROR_ARGUMENT;
  }
  (void)snprintf(posture, sizeof posture, "%.*s", (int)length, text);
  return read_state(posture, state, error);
}

#define FILLS(member) SUPINE_FILLS(request, member)

static const supine_option table[] = {
    {"state", 0, "[POSTURE[:VOLUME]:]SURFACE",
     "surface of the same lungs in another state; its mesh may differ from that of the basis. May "
     "be repeated, up to 8 times. The second points of landmarks are in the first --state",
     .read = append_state, .repeats = true,
     .wants = "SURFACE, POSTURE:SURFACE or POSTURE:VOLUME:SURFACE (at most 8 times)"},
    {.table = supine_options_landmarks, FILLS(landmarks)},
    {"from", 0, "POSTURE[:VOLUME]",
     "state in which the motion starts, and in which the first points of landmarks are; default "
     "the scan",
     FILLS(from), .read = read_state, .wants = "a state, such as supine:rest"},
    {"to", 0, "POSTURE[:VOLUME]",
     "without --state, the state of the second points of landmarks; give its volume too. With "
     "--state, the state of the surfaces for which --state names no posture; default supine, at "
     "the volume of the surface",
     FILLS(to), .read = read_state, .wants = "a state, such as prone:rest+500"},
    {.table = supine_options_surface_frame, FILLS(source.load)},
    {"output", 'o', "FILE",
     "file of local errors to write. .png: a picture of every state; .ply or .vtp: the predicted "
     "surface of the first --state, with its displacement from the nearest points of the scanned "
     "surface, in mm",
     FILLS(path), .file = SUPINE_FILE_OUT, .endings = ".png, .ply or .vtp"},
    {.name = NULL}};

static void set_default_posture(supine_state *state, const double gravity[3]) {
  const double *g = state->gravity;
  if (g[0] == 0.0 && g[1] == 0.0 && g[2] == 0.0) {
    memcpy(state->gravity, gravity, sizeof state->gravity);
  }
}

/* Set the states to compare. A posture or a volume that was not given is that of --to. */
static void set_states(const request *wanted, supine_validation *s) {
  static const double supine[3] = {0.0, 1.0, 0.0};
  supine_state to = wanted->to.state;
  set_default_posture(&to, supine);
  s->from = wanted->from;
  set_default_posture(&s->from.state, supine);
  s->count = wanted->count > 0 ? wanted->count : 1;
  for (size_t i = 0; i < s->count; ++i) {
    supine_state *state = &s->state[i].state;
    s->state[i] = wanted->state[i];
    set_default_posture(state, to.gravity);
    if (state->volume.kind == SUPINE_VOLUME_DEFAULT) {
      state->volume = to.volume;
    }
  }
}

static supine_status write_errors(const request *wanted, const supine_validation *s,
                                  supine_error *error) {
  if (supine_text_ends_in(wanted->path, ".png")) {
    return supine_command_draw_errors(s, wanted->path, error);
  }
  const supine_mesh shown = {s->start.vertex_count, s->outcome[0].predicted,
                             s->start.triangle_count, s->start.triangles};
  const supine_mesh_save_options save = {.from = s->outcome[0].nearest};
  return supine_mesh_save(wanted->path, &shown, &save, error);
}

/* Warn if the scan of state i, or landmarks, hardly are of the person of the basis. */
static supine_status tell_other_person(const supine_validation *s, size_t i,
                                       const supine_lungs *scan, const supine_patient_pairs *pairs,
                                       supine_error *error) {
  supine_findings findings = {.count = 0};
  supine_status status = SUPINE_OK;
  if (scan != NULL) {
    supine_validation_check_person(s, i, scan, &findings);
  }
  if (pairs != NULL) {
    status = supine_validation_check_landmarks(s, scan != NULL ? &scan->mesh : NULL, pairs,
                                               &findings, error);
  }
  supine_options_say_findings(name, &findings);
  return status;
}

/* Compare state i with its scan, and with the landmarks if it is the first. */
static supine_status validate_state(const request *wanted, supine_validation *s, size_t i,
                                    supine_error *error) {
  const char *path = s->state[i].path;
  const char *landmarks = i == 0 ? wanted->landmarks.path : NULL;
  SUPINE_FREED_BY(supine_lungs_free) supine_lungs lungs = {0};
  SUPINE_FREED_BY(supine_patient_pairs_free) supine_patient_pairs pairs = {0};
  if (path != NULL) {
    SUPINE_TRY(supine_options_load_lungs(name, path, &wanted->source, &lungs, error));
  }
  if (landmarks != NULL) {
    SUPINE_TRY(supine_patient_pairs_load(landmarks, wanted->landmarks.reverse, &pairs, error));
    SUPINE_TRY(supine_options_drop_mismatched(name, landmarks, &pairs, error));
  }
  const supine_lungs *scan = path != NULL ? &lungs : NULL;
  const supine_patient_pairs *given = landmarks != NULL ? &pairs : NULL;
  SUPINE_TRY(tell_other_person(s, i, scan, given, error));
  SUPINE_TRY(supine_validation_compare(s, i, scan != NULL ? &scan->mesh : NULL, given, error));
  return supine_options_tell_folds(s->basis, name, &s->outcome[i].state, &s->outcome[i].pose,
                                   error);
}

static supine_status validate(const request *wanted, supine_validation *s, supine_error *error) {
  SUPINE_FREED_BY(supine_options_progress_end)
  supine_progress progress = supine_options_progress_begin(name);
  for (size_t i = 0; i < s->count; ++i) {
    SUPINE_TRY(validate_state(wanted, s, i, error));
    (void)supine_options_progress_step(&progress, (double)(i + 1) / (double)s->count);
  }
  supine_validation_find_line(s);
  return wanted->path != NULL ? write_errors(wanted, s, error) : SUPINE_OK;
}

static supine_status run(void *chosen, const supine_arguments *given, supine_error *error) {
  const request *wanted = chosen;
  const char *path = given->operand[0];
  SUPINE_FREED_BY(supine_options_basis_close) supine_basis *basis = NULL;
  SUPINE_FREED_BY(supine_validation_free) supine_validation s = {0};
  SUPINE_REFUSE_IF(wanted->count == 0 && wanted->landmarks.path == NULL, error,
                   SUPINE_ERROR_ARGUMENT, "nothing to compare with: give --state or --landmarks");
  SUPINE_REFUSE_IF(wanted->path != NULL && wanted->count == 0, error, SUPINE_ERROR_ARGUMENT,
                   "-o writes the errors of a surface: name a surface with --state");
  if (wanted->path != NULL) {
    for (size_t i = 0; i < wanted->count; ++i) {
      SUPINE_TRY(supine_options_check_output(wanted->path, wanted->state[i].path, error));
    }
  }
  SUPINE_REFUSE_IF(supine_text_ends_in(path, ".json"), error, SUPINE_ERROR_ARGUMENT,
                   "%s is a patient model without a surface: make a basis from it first with "
                   "'supine precompute --patient'",
                   path);
  s.moved = supine_options_scan_motion(&wanted->landmarks);
  set_states(wanted, &s);
  SUPINE_TRY(supine_options_basis_open(path, SUPINE_STORAGE_AUTO, true, &basis, error));
  s.basis = basis;
  SUPINE_TRY(supine_validation_begin(&s, error));
  if (wanted->from.text[0] != '\0') {
    supine_pose pose;
    SUPINE_TRY(supine_options_pose(basis, name, &s.from.state, &pose, error));
  }
  SUPINE_TRY(validate(wanted, &s, error));
  supine_command_print_validation(&s);
  return SUPINE_OK;
}

const supine_command supine_command_validate = {
    name,
    "compare a basis with another scan of the patient",
    .usage = "BASIS --state [POSTURE[:VOLUME]:]SURFACE [--landmarks PAIRS.csv] [OPTIONS]\n"
             "BASIS --landmarks PAIRS.csv --to POSTURE:VOLUME [OPTIONS]",
    .about = "Compares a basis with other states of the same patient. Reports the distances "
             "between the surfaces and between landmarks, and how much of the motion is explained, "
             "in comparison with no motion, a translation and an affine map. With several states, "
             "reports whether the displacement is linear in volume.",
    .options = table,
    .notes =
        "POSTURE is a name such as prone or supine+15, or a direction of gravity such as "
        "0.6:0:-0.8. VOLUME is " SUPINE_VOLUME_HELP
        ".\nDistances between surfaces are measured in both directions; the largest is the "
        "Hausdorff distance. The translation and the affine map are fitted to the other state. "
        "'explained' is 1 minus the ratio of the mean squared distances with and without the "
        "motion. A small distance between surfaces does not prove that the motion inside is right; "
        "landmarks measure that. Santhanam 2008 reported surfaces 2 mm apart, in smaller "
        "breaths.\nWith several states, the factor on the displacement that brings the predicted "
        "surface nearest to the scanned one is also sought for each state. For states in the "
        "posture of the first --state, a straight line is fitted to factor against volume, with "
        "factor 0 at the volume of --from. Its largest deviation is given in percent of the "
        "largest factor.\n\nExamples:\n  supine validate lungs.safetensors --state prone:prone.ply "
        "-o errors.png\n  supine validate lungs.safetensors --from supine:rest --state "
        "supine:mid.ply \\\n      --state supine:full:full.ply --landmarks pairs.csv",
    SUPINE_ONE_BASIS,
    .request_size = sizeof(request),
    .uses_blas = true,
    .run = run};
