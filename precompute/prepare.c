/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Select the displacement law, stiffness, lesions and reference volumes of a model. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include <supine/inputs.h>

#include "base/arena.h"
#include "base/number.h"
#include "base/remedy.h"
#include "base/text.h"
#include "base/vec3.h"

#include "precompute/lungs/disease.h"
#include "precompute/lungs/expandability.h"
#include "precompute/patient/checks.h"
#include "precompute/prepare.h"

/* What is known of the scan: completed by the patient's file and by defaults. */
typedef struct knowledge {
  bool has_scan; /* whether `scan` is given */
  supine_scan scan;
  supine_resting resting;
  supine_person person;
} knowledge;

/* The laws of the public header follow its DEFAULT, in the order of those here. */
#define SAME_LAW(id, ...)                                                                          \
  _Static_assert((int)SUPINE_PRECOMPUTE_LAW_##id == (int)SUPINE_LAW_##id + 1,                      \
                 "supine_precompute_law_kind lists the laws in the order of SUPINE_LAWS");
SUPINE_LAWS(SAME_LAW)
_Static_assert((int)SUPINE_PRECOMPUTE_LAW_COUNT == (int)SUPINE_LAW_COUNT + 1, "as many laws");

supine_precompute_law_kind supine_precompute_law_of(supine_law law) {
  return (supine_precompute_law_kind)((int)law + 1);
}

/* Select the displacement law. Constants that the user gives override its constants. */
static supine_status choose_law(const supine_precompute_options *options, supine_model *chosen,
                                supine_error *error) {
  const supine_precompute_law *given = &options->law;
  supine_law law = SUPINE_LAW_DEEP;
  SUPINE_REFUSE_IF((int)given->kind < 0 || given->kind >= SUPINE_PRECOMPUTE_LAW_COUNT, error,
                   SUPINE_ERROR_ARGUMENT, "law %d: give a supine_precompute_law_kind",
                   (int)given->kind);
  if (given->kind != SUPINE_PRECOMPUTE_LAW_DEFAULT) {
    law = (supine_law)((int)given->kind - 1);
  } else if (options->scan.shown == SUPINE_SHOWN_UNKNOWN || options->fields != NULL) {
    law = SUPINE_LAW_PAPER;
  }
  supine_model model = supine_physics_model(law);
  model.force.soften = given->soften;
  if (given->reach > 0.0) {
    model.reach = given->reach;
  }
  if (given->has_base || given->base != 0.0) {
    model.force.base = given->base;
  }
  if (given->has_gain || given->gain != 0.0) {
    model.force.gain = given->gain;
  }
  if (given->has_shear || given->shear != 0.0) {
    model.direction.shear = given->shear;
  }
  const double *box = given->box_force;
  if (given->has_box_force || box[0] != 0.0 || box[1] != 0.0 || box[2] != 0.0) {
    memcpy(model.force.box, box, sizeof model.force.box);
  }
  const double *c = given->constants;
  if (given->has_constants || c[0] != 0.0 || c[2] != 0.0 || c[4] != 0.0) {
    memcpy(model.direction.c, c, sizeof model.direction.c);
  }
  *chosen = model;
  return SUPINE_OK;
}

/* Say what volume the law gives the lungs in the state that was not scanned. */
static void tell_volume(const supine_patient_record *record, supine_findings *findings) {
  char text[512];
  const bool doubted = supine_patient_describe_volume(record, text, sizeof text);
  if (doubted) {
    supine_findings_warn(findings, "%s: fit the patient's law to landmarks, too", text);
  } else {
    supine_findings_note(findings, "%s", text);
  }
}

static void describe_fit(const supine_patient_record *record, char *text, size_t size) {
  const supine_patient_fit_report *report = &record->report;
  (void)supine_print_text(
      text, size,
      "%s: %s law%s from %zu points; held-out residual %.1f of %.1f mm RMS, %.0f %% "
      "explained; expected error %.1f mm RMS",
      record->name, supine_patient_law_names[record->patient.law],
      record->patient.centre_count > 0 ? " and kriging" : "", report->points,
      report->held_out[SUPINE_PATIENT_SCORE_CORRECTED], report->baseline, report->explained,
      report->expected_point);
}

/* Use the displacement law, the force and the volumes at rest that were fitted to a patient.
 * @param scan  written: the state of the scan by the fit */
static supine_status take_patient(const supine_patient_record *fitted, supine_prepared *p,
                                  supine_resting *resting, supine_scan *scan, supine_error *error) {
  const size_t n = p->source.lungs.mesh.vertex_count;
  double *arrays = supine_arena_take(&p->memory, 4 * n, sizeof *arrays);
  supine_patient_record *record = supine_arena_take(&p->memory, 1, sizeof *record);
  SUPINE_TRY(supine_arena_check(&p->memory, error, "%zu vertices", n));
  *record = *fitted;
  p->patient = record;
  describe_fit(record, p->fit, sizeof p->fit);
  p->model = supine_physics_model(SUPINE_LAW_DEEP);
  SUPINE_TRY(
      supine_patient_model(record, &p->source.lungs, resting, scan, arrays, &p->model, error));
  tell_volume(record, &p->source.findings);
  return supine_patient_check_lungs(fitted, record->shown, &p->source.lungs, &p->source.findings,
                                    error);
}

/* Say that the state of the scan is taken from the fit. Refuse a scan whose state the fit does not
 * tell. */
static supine_status assume_fitted_state(const supine_patient_record *record,
                                         const supine_scan *scan, supine_findings *findings,
                                         supine_error *error) {
  supine_findings_note(findings, "the scan is assumed to be the %s of the two that were fitted",
                       record->shown == 0 ? "fuller" : "emptier");
  const supine_remedy change[SUPINE_REMEDIES_MAX] = {
      supine_remedy_change("scanned", "if it is not")};
  const supine_remedy give[SUPINE_REMEDIES_MAX] = {
      supine_remedy_such_as("scanned", "supine:rest", "for this one")};
  supine_findings_advise(findings, change);
  SUPINE_REFUSE_ADVISE(record->shown == 1 && !scan->known, error, give, SUPINE_ERROR_ARGUMENT,
                       "this scan is the emptier of the two that were fitted, and how far it is "
                       "below full inflation is unknown: use the fuller scan");
  return SUPINE_OK;
}

/* Choose the model: the patient's, or that of the displacement law. Without a given state of the
 * scan, also choose this state. */
static supine_status choose_model(const supine_precompute_options *options,
                                  const supine_patient_record *patient, supine_prepared *p,
                                  knowledge *known, supine_error *error) {
  if (patient != NULL) {
    supine_scan fitted;
    SUPINE_TRY(take_patient(patient, p, &known->resting, &fitted, error));
    if (!known->has_scan) {
      known->has_scan = true;
      known->scan = fitted;
      SUPINE_TRY(assume_fitted_state(p->patient, &fitted, &p->source.findings, error));
    } else if (known->scan.known && fitted.known) {
      const double *held = p->source.lungs.volume;
      supine_patient_check_state(&known->scan.state, &fitted.state, held[0] + held[1],
                                 &known->resting, &p->source.findings);
    }
    return SUPINE_OK;
  }
  SUPINE_TRY(choose_law(options, &p->model, error));
  if (!known->has_scan && !p->model.from_scan) {
    (void)supine_physics_reference_scan_parse("full", &known->scan, NULL);
  }
  return SUPINE_OK;
}

static supine_status set_expandability(const supine_precompute_tissue *tissue, supine_prepared *p,
                                       supine_error *error) {
  const size_t n = p->source.lungs.mesh.vertex_count;
  if (tissue->expandability == NULL && tissue->profile == SUPINE_PROFILE_UNIFORM) {
    return SUPINE_OK;
  }
  const supine_remedy advice[SUPINE_REMEDIES_MAX] = {supine_remedy_omit("expandability")};
  SUPINE_REFUSE_ADVISE(p->model.stiffness != NULL, error, advice, SUPINE_ERROR_ARGUMENT,
                       "the patient's file sets the stiffness");
  double *a = supine_arena_take(&p->memory, n, sizeof *a);
  SUPINE_TRY(supine_arena_check(&p->memory, error, "%zu vertices", n));
  if (tissue->expandability != NULL) {
    SUPINE_TRY(supine_lungs_expandability_load(tissue->expandability, n, a, error));
  } else {
    const supine_expandability_law law = {.shape = tissue->profile == SUPINE_PROFILE_LINEAR
                                                       ? SUPINE_EXPANDABILITY_LINEAR
                                                       : SUPINE_EXPANDABILITY_EXPONENTIAL,
                                          .axis = tissue->axis,
                                          .from = tissue->from,
                                          .to = tissue->to};
    SUPINE_REFUSE_IF(!(law.axis >= 0 && law.axis <= 2 && law.from > 0.0 && law.to > 0.0), error,
                     SUPINE_ERROR_ARGUMENT,
                     "expandability along axis %d from %g to %g: give an axis 0 to 2, and values "
                     "above 0",
                     law.axis, law.from, law.to);
    supine_lungs_expandability_regional(&p->source.lungs, &law, a);
  }
  for (size_t i = 0; i < n; ++i) {
    a[i] = 1.0 / a[i];
  }
  p->model.stiffness = a;
  return SUPINE_OK;
}

/* Warn of a lesion that contains no vertex and therefore changes no stiffness. */
static void warn_of_lesion(const supine_lungs *lungs, const supine_lesion *lesion,
                           supine_findings *findings) {
  const double *c = lesion->centre;
  double nearest = INFINITY;
  for (size_t i = 0; i < 3 * lungs->mesh.vertex_count; i += 3) {
    nearest = fmin(nearest, supine_distance(lungs->mesh.vertices + i, c));
  }
  supine_findings_warn(
      findings,
      "the lesion at %g,%g,%g is %.0f mm from the nearest vertex of the surface: with a "
      "radius of %g mm it changes nothing: correct its centre or radius",
      c[0], c[1], c[2], nearest, lesion->radius);
}

static supine_status set_lesions(const supine_precompute_tissue *tissue, supine_prepared *p,
                                 supine_error *error) {
  const supine_lungs *lungs = &p->source.lungs;
  const size_t n = lungs->mesh.vertex_count;
  if (tissue->lesion_count == 0) {
    return SUPINE_OK;
  }
  SUPINE_REFUSE_IF(tissue->lesion_count > SUPINE_PRECOMPUTE_LESIONS_MAX, error,
                   SUPINE_ERROR_ARGUMENT, "%zu lesions: give at most %d", tissue->lesion_count,
                   SUPINE_PRECOMPUTE_LESIONS_MAX);
  double *factors = supine_arena_take(&p->memory, n, sizeof *factors);
  SUPINE_TRY(supine_arena_check(&p->memory, error, "%zu vertices", n));
  for (size_t i = 0; i < n; ++i) {
    factors[i] = 1.0;
  }
  for (size_t l = 0; l < tissue->lesion_count; ++l) {
    const supine_precompute_lesion *given = &tissue->lesions[l];
    const double *c = given->centre;
    const supine_lesion lesion = {{c[0], c[1], c[2]}, given->radius, given->factor};
    size_t reached = 0;
    SUPINE_TRY(supine_lungs_add_lesion(lungs, &lesion, factors, &reached, error));
    if (reached == 0) {
      warn_of_lesion(lungs, &lesion, &p->source.findings);
    }
  }
  p->model.lesions = factors;
  return SUPINE_OK;
}

static supine_status set_shares(const supine_precompute_tissue *tissue, supine_prepared *p,
                                supine_error *error) {
  const supine_lungs *lungs = &p->source.lungs;
  for (size_t side = 0; side < 2; ++side) {
    const char *name = side == 0 ? "left" : "right";
    const double share = tissue->share[side];
    size_t lung = 0;
    while (lung < lungs->lung_count && lungs->side[lung] != (side == 0 ? 1 : -1)) {
      ++lung;
    }
    if (share != 0.0) {
      const double least = supine_input_get(SUPINE_INPUT_LUNG_SHARE)->refused;
      SUPINE_REFUSE_IF(!(share >= least && share <= 1.0), error, SUPINE_ERROR_ARGUMENT,
                       "the %s lung's share of its healthy volume is %g: give %g, which the tissue "
                       "alone fills, to 1",
                       name, share, least);
      SUPINE_REFUSE_IF(
          lung == lungs->lung_count, error, SUPINE_ERROR_ARGUMENT,
          "a share of the %s lung was given, but the model has no %s lung: leave it out", name,
          name);
      p->model.share[lung] = share;
    }
  }
  return SUPINE_OK;
}

/* Whether the expandability differs between vertices. */
static bool varies(const supine_model *model, size_t count) {
  bool same = true;
  for (size_t i = 0; i < count && same; ++i) {
    same = (model->stiffness == NULL || model->stiffness[i] == model->stiffness[0]) &&
           (model->lesions == NULL || model->lesions[i] == 1.0);
  }
  return !same;
}

/* Return the word of the metadata "sources" for what the volume at rest is known from. */
static const char *source_of_rest(const supine_resting *resting, const supine_prepared *p) {
  if (p->reference.scan.state.volume.kind == SUPINE_VOLUME_REST &&
      p->reference.scan.state.volume.ml == 0.0) {
    return "scan";
  }
  if (p->patient != NULL) {
    return "fit";
  }
  if (supine_physics_resting_given(resting) || p->named.has_rest) {
    return "given";
  }
  if (resting->predicted) {
    return "person";
  }
  return resting->assumed == SUPINE_REST_SHARE ? "healthy" : "copd";
}

/* Return the word of the metadata "sources" for what full inflation is known from. */
static const char *source_of_full(const supine_resting *resting, const supine_prepared *p) {
  const supine_scan *scan = &p->reference.scan;
  if (scan->full > 0.0 || p->named.full > 0.0) {
    return "given";
  }
  if (scan->state.volume.kind == SUPINE_VOLUME_REST) {
    return supine_physics_resting_given(resting) ? "given-rest" : "rest";
  }
  return scan->state.volume.ml == 0.0 ? "scan" : "given";
}

/* Say where the axes, the state of the scan and the volumes come from, in the words of
 * supine_basis_facts. */
static void list_sources(const supine_precompute_options *options, const supine_resting *resting,
                         supine_prepared *p) {
  const size_t size = sizeof p->sources;
  const char *scan = p->patient != NULL ? "fit" : "default";
  if (options->scan.shown != SUPINE_SHOWN_DEFAULT) {
    scan = "given";
  }
  supine_text_add(p->sources, size, "axes=%s,scan=%s", p->source.axes_from, scan);
  if (p->reference.known || p->named.has_rest) {
    supine_text_add(p->sources, size, ",rest=%s", source_of_rest(resting, p));
  }
  if (p->reference.known || p->named.full > 0.0) {
    supine_text_add(p->sources, size, ",full=%s", source_of_full(resting, p));
  }
}

/* Add the volume at full inflation to the state of the scan, and check that the law and this volume
 * go with it. */
static supine_status complete_scan(const supine_precompute_volumes *volumes,
                                   const supine_model *model, supine_scan *scan,
                                   supine_error *error) {
  const supine_remedy no_state[SUPINE_REMEDIES_MAX] = {supine_remedy_omit("scanned"),
                                                       supine_remedy_give("law", "deep", "")};
  SUPINE_REFUSE_ADVISE(
      model->from_scan && scan->known, error, no_state, SUPINE_ERROR_ARGUMENT,
      "the law '%s' takes the scan as the reference, but the state of the scan was given",
      supine_physics_law_names[model->law]);
  const supine_volume_kind kind = scan->state.volume.kind;
  SUPINE_REFUSE_IF(scan->known && kind == SUPINE_VOLUME_DEFAULT, error, SUPINE_ERROR_ARGUMENT,
                   "the state of the scan is a posture alone, which is only for another "
                   "simulator's fields: add the volume, as in supine:rest, or give full or none");
  SUPINE_REFUSE_IF(scan->known && kind != SUPINE_VOLUME_REST && kind != SUPINE_VOLUME_FULL, error,
                   SUPINE_ERROR_ARGUMENT,
                   "the state of the scan must be rest or full inflation, plus or minus a volume");
  SUPINE_REFUSE_IF(!(volumes->full >= 0.0), error, SUPINE_ERROR_ARGUMENT,
                   "the volume at full inflation is %g mL: give a volume above 0", volumes->full);
  const supine_remedy at_rest[SUPINE_REMEDIES_MAX] = {
      supine_remedy_such_as("scanned", "supine:rest", ""), supine_remedy_omit("full")};
  SUPINE_REFUSE_ADVISE(volumes->full != 0.0 && kind != SUPINE_VOLUME_REST, error, at_rest,
                       SUPINE_ERROR_ARGUMENT, "the volume at full inflation is for a scan at rest");
  scan->full = volumes->full;
  return SUPINE_OK;
}

/* Return the volume of all lungs at rest with gravity along an axis, in the usual proportion to
 * their volumes at full inflation. */
static double rest_along(const supine_lungs *lungs, const supine_resting *resting,
                         const double *full, size_t axis) {
  double g[3];
  double sum = 0.0;
  supine_physics_resting_axis(axis, g);
  for (size_t lung = 0; lung < lungs->lung_count; ++lung) {
    sum += full[lung] * supine_physics_resting_share(resting, lungs->side[lung], g);
  }
  return sum;
}

/* Find the volumes at rest and at full inflation of another simulator's lungs. Without the volume
 * at full inflation, the given volumes at rest are the usual share of it. */
static supine_status name_volumes(const supine_precompute_options *options,
                                  const supine_resting *resting, supine_prepared *p,
                                  supine_error *error) {
  const supine_lungs *lungs = &p->source.lungs;
  const supine_resting usual = supine_physics_resting_default();
  supine_resting settled = *resting;
  supine_named_volumes *named = &p->named;
  bool in_ml = !options->volumes.copd;
  double scanned = 0.0;
  double full[2];
  named->full = options->volumes.full;
  named->has_rest = options->volumes.copd || supine_physics_resting_given(resting);
  SUPINE_REFUSE_IF(!(named->full >= 0.0 && isfinite(named->full)), error, SUPINE_ERROR_ARGUMENT,
                   "a volume of %g mL at full inflation: give a number above 0", named->full);
  if (!named->has_rest) {
    return SUPINE_OK;
  }
  for (size_t lung = 0; lung < lungs->lung_count; ++lung) {
    scanned += lungs->volume[lung];
  }
  double total = named->full;
  for (size_t axis = 0; axis < SUPINE_REST_COUNT; ++axis) {
    in_ml = in_ml && (!resting->given[axis] || resting->ml[axis] > 0.0);
    if (total == 0.0 && resting->ml[axis] > 0.0) {
      total = scanned * resting->ml[axis] / rest_along(lungs, &usual, lungs->volume, axis);
    }
  }
  SUPINE_REFUSE_IF(named->full == 0.0 && !in_ml, error, SUPINE_ERROR_ARGUMENT,
                   "the volume at rest is a share of full inflation, which is unknown: give the "
                   "volume at full inflation too, or the volume at rest in mL");
  for (size_t lung = 0; lung < lungs->lung_count; ++lung) {
    full[lung] = total * lungs->volume[lung] / scanned;
  }
  SUPINE_TRY(supine_physics_resting_settle(&settled, lungs->lung_count, lungs->side, full, error));
  for (size_t axis = 0; axis < SUPINE_REST_COUNT; ++axis) {
    named->rest[axis] = rest_along(lungs, &settled, full, axis);
  }
  return SUPINE_OK;
}

/* Read what the options tell of the scan and of the patient. */
static supine_status read_knowledge(const supine_precompute_options *options, supine_prepared *p,
                                    knowledge *known, supine_error *error) {
  const supine_precompute_volumes *volumes = &options->volumes;
  const bool has_state = options->scan.shown == SUPINE_SHOWN_STATE;
  *known = (knowledge){.has_scan = options->scan.shown != SUPINE_SHOWN_DEFAULT,
                       .scan = {.known = has_state, .state = options->scan.state},
                       .resting = supine_physics_resting_default(),
                       .person = {volumes->height, (supine_sex)volumes->sex}};
  if (volumes->copd) {
    SUPINE_TRY(supine_physics_resting_set(&known->resting, "copd", NULL, error));
  }
  for (size_t axis = 0; axis < SUPINE_REST_COUNT; ++axis) {
    const supine_precompute_rest *rest = &volumes->rest[axis];
    if (rest->ml != 0.0 || rest->share[0] != 0.0) {
      SUPINE_TRY(supine_physics_resting_give(&known->resting, axis, rest->ml, rest->share, error));
    }
  }
  SUPINE_REFUSE_IF(options->fields != NULL && options->patient != NULL, error,
                   SUPINE_ERROR_ARGUMENT,
                   "displacement fields and a patient's model were given: leave one of them out");
  if (options->fields != NULL) { /* they displace the surface as it is */
    SUPINE_REFUSE_IF(has_state && options->scan.state.volume.kind != SUPINE_VOLUME_DEFAULT, error,
                     SUPINE_ERROR_ARGUMENT,
                     "the state of the scan: with another simulator's fields, give the posture "
                     "alone, such as supine: the volume is that of the surface");
    p->posture = known->scan;
    known->scan = (supine_scan){.known = false};
    known->has_scan = true;
  }
  return SUPINE_OK;
}

/* Set the law, and the stiffness and collapse of the tissue. */
static supine_status set_model(const supine_precompute_options *options,
                               const supine_patient_record *patient, supine_prepared *p,
                               knowledge *known, supine_error *error) {
  const supine_lungs *lungs = &p->source.lungs;
  SUPINE_TRY(choose_model(options, patient, p, known, error));
  if (options->fields != NULL) {
    SUPINE_TRY(name_volumes(options, &known->resting, p, error));
  } else {
    SUPINE_TRY(complete_scan(&options->volumes, &p->model, &known->scan, error));
  }
  SUPINE_TRY(set_expandability(&options->tissue, p, error));
  SUPINE_TRY(set_lesions(&options->tissue, p, error));
  SUPINE_TRY(set_shares(&options->tissue, p, error));
  if (p->model.reach > 0.0 && varies(&p->model, lungs->mesh.vertex_count)) {
    SUPINE_TRY(supine_physics_strain_create(lungs, p->model.stiffness, p->model.lesions,
                                            &p->model.strain, error));
  }
  return SUPINE_OK;
}

/* Warn of a height outside those of the equations. Refuse a volume at rest that it predicts if the
 * scanned lungs, at full inflation, can hardly hold it. */
static supine_status check_height(const knowledge *known, const supine_resting *resting,
                                  supine_prepared *p, supine_error *error) {
  static const double least = 50.0; /* cm */
  static const double most = 250.0;
  const double height = known->person.height;
  const supine_lungs *lungs = &p->source.lungs;
  double full = -known->scan.state.volume.ml;
  double range[2];
  SUPINE_REFUSE_IF(
      height != 0.0 && !(height >= least && height <= most), error, SUPINE_ERROR_ARGUMENT,
      "the height is %g cm: give %g to %g cm, such as 175 (1.75 m)", height, least, most);
  if (supine_physics_reference_height_is_told(&known->person, range)) {
    supine_findings_warn(&p->source.findings,
                         "the height of %g cm is outside the %.0f to %.0f cm of the adults "
                         "for whom the equations are stated: give the volume at rest or at full "
                         "inflation",
                         known->person.height, range[0], range[1]);
  }
  for (size_t lung = 0; lung < lungs->lung_count; ++lung) {
    full += lungs->volume[lung];
  }
  const double share = resting->predicted ? resting->ml[2] / full : 0.0;
  const supine_input_verdict verdict = supine_input_judge(SUPINE_INPUT_REST_SHARE, share);
  SUPINE_REFUSE_IF(verdict == SUPINE_INPUT_REFUSED, error, SUPINE_ERROR_ARGUMENT,
                   "a height of %g cm predicts %.0f mL at rest, %.0f %% of the %.0f mL that the "
                   "lungs hold at full inflation: check the height and the state of the scan, or "
                   "give the volume at rest",
                   known->person.height, resting->ml[2], 100.0 * share, full);
  return SUPINE_OK;
}

/* Move the scan to the reference surface. Complete the volumes at rest. */
static supine_status find_reference(supine_prepared *p, const knowledge *known,
                                    supine_resting *resting, supine_error *error) {
  supine_lungs *lungs = &p->source.lungs;
  const supine_reference scanned = {.scan = known->scan,
                                    .lung_count = lungs->lung_count,
                                    .side = {lungs->side[0], lungs->side[1]}};
  supine_physics_reference_predict_rest(&scanned, &known->person, resting);
  SUPINE_TRY(check_height(known, resting, p, error));
  SUPINE_TRY(
      supine_physics_reference_find(lungs, &p->model, &known->scan, resting, &p->reference, error));
  if (p->reference.known) {
    supine_physics_reference_compare(&p->reference, &known->person, p->expected,
                                     sizeof p->expected);
    supine_physics_reference_doubt(&p->reference, &known->person, &known->resting,
                                   &p->source.findings);
  }
  return SUPINE_OK;
}

supine_status supine_precompute_prepare(const supine_precompute_options *options,
                                        supine_prepared *prepared, supine_error *error) {
  supine_patient_record *patient = NULL;
  knowledge known;
  SUPINE_TRY(read_knowledge(options, prepared, &known, error));
  if (options->patient != NULL) {
    patient = supine_arena_take(&prepared->memory, 1, sizeof *patient);
    SUPINE_TRY(supine_arena_check(&prepared->memory, error, "%s", options->patient));
    SUPINE_TRY(supine_patient_read(options->patient, patient, error));
  }
  SUPINE_TRY(supine_precompute_source_load_lungs(options, &prepared->source, error));
  SUPINE_TRY(set_model(options, patient, prepared, &known, error));
  supine_resting resting = known.resting;
  if (options->fields == NULL) {
    SUPINE_TRY(find_reference(prepared, &known, &resting, error));
  }
  list_sources(options, &resting, prepared);
  return SUPINE_OK;
}

void supine_precompute_prepared_free(supine_prepared *prepared) {
  supine_physics_strain_destroy(prepared->model.strain);
  supine_lungs_free(&prepared->source.lungs);
  supine_arena_free(&prepared->memory);
}
