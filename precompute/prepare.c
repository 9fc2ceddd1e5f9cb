/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Select the displacement law, stiffness, lesions and reference volumes of a model. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/arena.h"
#include "base/number.h"
#include "base/text.h"
#include "base/vec3.h"

#include "precompute/prepare.h"

supine_model_choice supine_precompute_choice_default(void) {
  supine_model_choice choice = {.law = SUPINE_LAW_COUNT,
                                .model = supine_physics_model(SUPINE_LAW_PAPER),
                                .resting = supine_reference_resting_default()};
  choice.model.reach = choice.model.force.base = choice.model.force.gain = NAN;
  choice.model.force.box[0] = choice.model.direction.c[0] = NAN;
  choice.model.direction.shear = NAN;
  return choice;
}

/* Select the displacement law. Constants that the user gives override its constants. */
static supine_model choose_law(const supine_model_choice *choice) {
  const bool none = choice->has_scan && !choice->scan.known;
  const supine_model law = supine_physics_model(choice->law != SUPINE_LAW_COUNT
                                                    ? (supine_law)choice->law
                                                    : (none ? SUPINE_LAW_PAPER : SUPINE_LAW_DEEP));
  supine_model model = choice->model;
  model.law = law.law;
  model.force.pair = law.force.pair;
  memcpy(model.bend, law.bend, sizeof law.bend);
  model.reach = isnan(model.reach) ? law.reach : model.reach;
  model.force.base = isnan(model.force.base) ? law.force.base : model.force.base;
  model.force.gain = isnan(model.force.gain) ? law.force.gain : model.force.gain;
  model.direction.shear =
      isnan(model.direction.shear) ? law.direction.shear : model.direction.shear;
  if (isnan(model.force.box[0])) {
    memcpy(model.force.box, law.force.box, sizeof law.force.box);
  }
  if (isnan(model.direction.c[0])) {
    memcpy(model.direction.c, law.direction.c, sizeof law.direction.c);
  }
  return model;
}

/* Say what volume the law gives the lungs in the state that was not scanned. */
static void tell_volume(const supine_patient_record *record, supine_findings *findings) {
  char text[512];
  const bool doubted = supine_patient_describe_volume(record, text, sizeof text);
  supine_findings_add(findings, "%s: %s", doubted ? "warning" : "note", text);
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

/* Use the displacement law and the force that were fitted to a patient.
 * @param resting  in: the chosen volumes at rest; out: those of the patient
 * @param scan     written: the state of the scan by the fit */
static supine_status take_patient(const supine_patient_record *fitted, supine_prepared *p,
                                  supine_resting *resting, supine_scan *scan, supine_error *error) {
  const size_t n = p->source.lungs.mesh.vertex_count;
  supine_patient_record *record = supine_arena_take(&p->memory, 1, sizeof *record);
  double *arrays = supine_arena_take(&p->memory, 4 * n, sizeof *arrays);
  SUPINE_TRY(supine_arena_check(&p->memory, error, "%zu vertices", n));
  *record = *fitted;
  p->patient = record;
  describe_fit(record, p->fit, sizeof p->fit);
  p->model = supine_physics_model(SUPINE_LAW_DEEP);
  SUPINE_TRY(
      supine_patient_model(record, &p->source.lungs, resting, scan, arrays, &p->model, error));
  tell_volume(record, &p->source.findings);
  return SUPINE_OK;
}

/* Say that the state of the scan is taken from the fit. Refuse a scan whose state the fit does not
 * tell. */
static supine_status assume_fitted_state(const supine_patient_record *record,
                                         const supine_scan *scan, supine_findings *findings,
                                         supine_error *error) {
  supine_findings_add(
      findings,
      "note: the scan is assumed to be the %s of the two that were fitted; --scanned changes this",
      record->shown == 0 ? "fuller" : "emptier");
  SUPINE_REFUSE_IF(record->shown == 1 && !scan->known, error, SUPINE_ERROR_ARGUMENT,
                   "this scan is the emptier of the two that were fitted, and how far it is below "
                   "full inflation is unknown: give its state, such as --scanned supine:rest, or "
                   "use the fuller scan");
  return SUPINE_OK;
}

static supine_status set_expandability(const supine_model_choice *choice, supine_prepared *p,
                                       supine_error *error) {
  const size_t n = p->source.lungs.mesh.vertex_count;
  if (choice->expandability == NULL &&
      choice->expandability_law.shape == SUPINE_EXPANDABILITY_UNIFORM) {
    return SUPINE_OK;
  }
  SUPINE_REFUSE_IF(p->model.stiffness != NULL, error, SUPINE_ERROR_ARGUMENT,
                   "the file of --patient sets the stiffness: leave --expandability out");
  double *a = supine_arena_take(&p->memory, n, sizeof *a);
  SUPINE_TRY(supine_arena_check(&p->memory, error, "%zu vertices", n));
  if (choice->expandability != NULL) {
    SUPINE_TRY(supine_tissue_expandability_load(choice->expandability, n, a, error));
  } else {
    supine_tissue_expandability_regional(&p->source.lungs, &choice->expandability_law, a);
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
  supine_findings_add(
      findings,
      "warning: the lesion at %g,%g,%g is %.0f mm from the nearest vertex of the surface: with a "
      "radius of %g mm it changes nothing: correct its centre or radius",
      c[0], c[1], c[2], nearest, lesion->radius);
}

static supine_status set_lesions(const supine_model_choice *choice, supine_prepared *p,
                                 supine_error *error) {
  const supine_lungs *lungs = &p->source.lungs;
  const size_t n = lungs->mesh.vertex_count;
  if (choice->lesion_count == 0) {
    return SUPINE_OK;
  }
  double *factors = supine_arena_take(&p->memory, n, sizeof *factors);
  SUPINE_TRY(supine_arena_check(&p->memory, error, "%zu vertices", n));
  for (size_t i = 0; i < n; ++i) {
    factors[i] = 1.0;
  }
  for (size_t l = 0; l < choice->lesion_count; ++l) {
    size_t reached = 0;
    SUPINE_TRY(supine_tissue_add_lesion(lungs, &choice->lesions[l], factors, &reached, error));
    if (reached == 0) {
      warn_of_lesion(lungs, &choice->lesions[l], &p->source.findings);
    }
  }
  p->model.lesions = factors;
  return SUPINE_OK;
}

static supine_status set_shares(const supine_model_choice *choice, supine_prepared *p,
                                supine_error *error) {
  const supine_lungs *lungs = &p->source.lungs;
  for (size_t side = 0; side < 2; ++side) {
    const char *name = side == 0 ? "left" : "right";
    size_t lung = 0;
    while (lung < lungs->lung_count && lungs->side[lung] != (side == 0 ? 1 : -1)) {
      ++lung;
    }
    SUPINE_REFUSE_IF(choice->share[side] > 0.0 && lung == lungs->lung_count, error,
                     SUPINE_ERROR_ARGUMENT, "--lung %s: the model has no %s lung: leave it out",
                     name, name);
    if (choice->share[side] > 0.0) {
      p->model.share[lung] = choice->share[side];
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

/* Describe what was assumed.
 * @param resting  volumes at rest before a prediction from height and sex */
static void summarize(const supine_model_choice *choice, const supine_resting *resting,
                      bool predicted, supine_prepared *p) {
  static const double supine[3] = {0.0, 1.0, 0.0};
  const supine_reference *reference = &p->reference;
  const size_t size = sizeof p->assumed;
  char state[160];
  double ml[2];
  supine_text_add(p->assumed, size, "%s; %s law; scan ", p->source.summary,
                  choice->patient != NULL ? "the patient's own"
                                          : supine_physics_law_names[p->model.law]);
  if (!reference->known) {
    supine_text_add(p->assumed, size, "taken as the reference of every posture");
    return;
  }
  (void)supine_state_describe(&reference->scan.state, state, sizeof state);
  const double full = reference->full_volume[0] + reference->full_volume[1];
  const double held = full + reference->scan_volume[0] + reference->scan_volume[1];
  const bool known = supine_reference_resting_given(resting);
  const bool at_rest = reference->scan.state.volume.kind == SUPINE_VOLUME_REST;
  if (held != full) {
    supine_text_add(p->assumed, size, "%s, %.0f mL; ", state, held);
  }
  supine_text_add(p->assumed, size, "%sfull inflation %.0f mL (%s", held != full ? "" : "at ", full,
                  reference->scan.full > 0.0 ? "given, "
                  : !at_rest                 ? ""
                  : known                    ? "from rest, "
                                             : "assumed from rest, ");
  supine_reference_compare(reference, &choice->person, p->assumed, size);
  const double rest = supine_reference_rest(reference, supine, ml);
  const double ratio = exp(resting->spread / resting->assumed);
  supine_text_add(p->assumed, size, "); rest supine %.0f mL (", rest);
  if (!at_rest && !known) {
    supine_text_add(p->assumed, size, "%.0f to %.0f ", rest / ratio, rest * ratio);
  }
  supine_text_add(p->assumed, size, "by %s)",
                  at_rest                                 ? "the scan"
                  : choice->patient != NULL               ? "the fit"
                  : known                                 ? "--resting"
                  : predicted                             ? "height and sex"
                  : resting->assumed == SUPINE_REST_SHARE ? "healthy people's share"
                                                          : "the share in COPD");
  double collapsed = 0.0; /* volume in the scan as the basis holds it, mL */
  for (size_t lung = 0; lung < reference->lung_count; ++lung) {
    collapsed +=
        p->model.share[lung] * (reference->full_volume[lung] + reference->scan_volume[lung]);
  }
  if (p->model.share[0] != 1.0 || p->model.share[1] != 1.0) {
    supine_text_add(
        p->assumed, size,
        "; collapsed in every state by --lung, also in the scan, which then holds %.0f "
        "mL: no displacement contains the collapse. For one that does, leave --lung out and "
        "give 'supine deform' a volume for each lung",
        collapsed);
  }
}

/* Add the volume at full inflation to the state of the scan, and check that the law and --full go
 * with it. */
static supine_status complete_scan(const supine_model_choice *choice, supine_law law,
                                   supine_scan *scan, supine_error *error) {
  SUPINE_REFUSE_IF(
      law == SUPINE_LAW_PAPER && scan->known, error, SUPINE_ERROR_ARGUMENT,
      "--law paper takes the scan as the reference: leave --scanned out, or use --law deep");
  SUPINE_REFUSE_IF(scan->known && scan->state.volume.kind == SUPINE_VOLUME_DEFAULT, error,
                   SUPINE_ERROR_ARGUMENT,
                   "--scanned: a posture alone is only for --fields: add the volume, as in "
                   "supine:rest, or give full or none");
  const supine_volume *full = &choice->full.volume;
  scan->full = full->ml;
  SUPINE_REFUSE_IF(
      full->kind != SUPINE_VOLUME_DEFAULT &&
          (full->kind != SUPINE_VOLUME_ABSOLUTE || scan->state.volume.kind != SUPINE_VOLUME_REST),
      error, SUPINE_ERROR_ARGUMENT,
      "--full is for a scan at rest: give a volume such as 4200mL, and --scanned supine:rest too");
  return SUPINE_OK;
}

/* Choose the model: the patient's, or that of the displacement law. Where they were not given, also
 * choose the volumes at rest and the state of the scan. */
static supine_status choose_model(const supine_model_choice *choice, supine_prepared *p,
                                  supine_resting *resting, supine_scan *scan, supine_error *error) {
  if (choice->patient != NULL) {
    supine_scan fitted;
    SUPINE_TRY(take_patient(choice->patient, p, resting, &fitted, error));
    if (!choice->has_scan) {
      *scan = fitted;
      SUPINE_TRY(assume_fitted_state(p->patient, scan, &p->source.findings, error));
    }
    return SUPINE_OK;
  }
  p->model = choose_law(choice);
  if (!choice->has_scan && p->model.law != SUPINE_LAW_PAPER) {
    (void)supine_reference_scan_parse("full", scan, NULL);
  }
  return SUPINE_OK;
}

supine_status supine_precompute_prepare(const supine_model_choice *choice, char **paths,
                                        size_t count, supine_prepared *prepared,
                                        supine_error *error) {
  supine_prepared *p = prepared;
  supine_lungs *lungs = &p->source.lungs;
  supine_resting resting = choice->resting;
  supine_scan scan = choice->scan;
  SUPINE_TRY(supine_precompute_source_load(&choice->source, paths, count, &p->source, error));
  SUPINE_TRY(choose_model(choice, p, &resting, &scan, error));
  SUPINE_TRY(complete_scan(choice, p->model.law, &scan, error));
  SUPINE_TRY(set_expandability(choice, p, error));
  SUPINE_TRY(set_lesions(choice, p, error));
  SUPINE_TRY(set_shares(choice, p, error));
  if (p->model.reach > 0.0 && varies(&p->model, lungs->mesh.vertex_count)) {
    SUPINE_TRY(supine_physics_strain_create(lungs, p->model.stiffness, p->model.lesions,
                                            &p->model.strain, error));
  }
  const supine_reference scanned = {
      .scan = scan, .lung_count = lungs->lung_count, .side = {lungs->side[0], lungs->side[1]}};
  supine_resting predicted = resting;
  supine_reference_predict_rest(&scanned, &choice->person, &predicted);
  SUPINE_TRY(supine_reference_find(lungs, &p->model, &scan, &predicted, &p->reference, error));
  summarize(choice, &resting, predicted.predicted, p);
  char doubt[512] = "";
  if (p->reference.known) {
    supine_reference_doubt(&p->reference, &choice->person, &resting, doubt, sizeof doubt);
  }
  if (doubt[0] != '\0') {
    supine_findings_add(&p->source.findings, "warning: %s", doubt);
  }
  return SUPINE_OK;
}

void supine_precompute_prepared_free(supine_prepared *prepared) {
  supine_physics_strain_destroy(prepared->model.strain);
  supine_lungs_free(&prepared->source.lungs);
  supine_arena_free(&prepared->memory);
}
